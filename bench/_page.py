"""The page of the benchmarks, `reports/bench/README.md`, from their JSON files; `python bench/_page.py` writes it.

A benchmark without a file is left out. What a benchmark is, is the first paragraph of its script's docstring.
"""

import ast
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import _measure
import _pareto
import _results
from _results import Benchmark, Row

from ddf import pages, stage

SCRIPTS = Path(__file__).resolve().parent
TITLE = "Speed against error"
PAPER_CLOUD = (128, 3)  # n_v and N_H of [DDF22]
CLOUD_DEPARTURES = ("jitter", "recheck", "spread")  # from it


@dataclass(frozen=True)
class View:
    """What the picture of a benchmark shows.

    error: key of the error drawn. label: its axis. panels: keys of `size` (or `what`) that rows of one panel share.
    best: for scores that are better when higher, the score that nothing exceeds; best - score is drawn.
    keep: rows that can be compared at all.
    """

    error: str
    label: str
    panels: tuple[str, ...] = ()
    best: float | None = None
    keep: Callable[[Row], bool] = lambda _: True

    def value(self, row: Row) -> float | None:
        """The error drawn; None where the row has none."""
        value = row.error.get(self.error)
        if value is None or self.best is None:
            return value
        return self.best - value


def _values_only(row: Row) -> bool:
    """Rows of one batch with all threads, without normals."""
    return "normals" not in row.size.get("outputs", ("normals",)) and row.size.get("threads", 1) > 1


def _samples_on_one_core(row: Row) -> bool:
    """Rows of the samples of a shape, not of its cloud."""
    return "counts" in row.size and row.size.get("threads") == 1


VIEWS: Mapping[str, View] = {
    "cloud_sampling": View("f_score_tau_x100", "points missed: 100 - 100 F(τ)", ("what",), best=100.0),
    "composition": View("soft_depth_mean", "mean error of the soft depth", ("what",)),
    "derivatives": View("relative_p999", "error over the median value, 99.9 %", ("quantity",)),
    "evaluation": View("chamfer_relative", "relative error of D_C"),
    "field_inference": View("depth_mean", "mean error of depth", ("width",), keep=_values_only),
    "rendering": View("depth_median", "median error of depth", keep=lambda row: "times_ddf" in row.told),
    "sample_extraction": View(
        "position_shift", "shift of a stored position", ("shape", "counts"), keep=_samples_on_one_core
    ),
    "training_step": View("gradient_relative", "relative error of the gradient", ("hidden",)),
}


def view(benchmark: Benchmark) -> View | None:
    """Of a benchmark: that of `VIEWS`, or its first error that is positive somewhere; None where there is none."""
    if benchmark.name in VIEWS:
        return VIEWS[benchmark.name]
    names = dict.fromkeys(name for row in benchmark.rows for name in row.error)
    found = next((name for name in names if any(row.error.get(name, 0.0) > 0 for row in benchmark.rows)), None)
    return None if found is None else View(found, found.replace("_", " "))


def number(value: float) -> str:
    """Three digits."""
    return f"{value:.3g}" if abs(value) < 1000 or value != value else f"{value:,.0f}"


def text(value: Any) -> str:
    """A value of `size`, or beside it, as printed."""
    if isinstance(value, bool) or value is None:
        return "yes" if value else "–"
    if isinstance(value, int):
        return f"{value:,}"
    if isinstance(value, float):
        return number(value)
    return ", ".join(map(text, value)) or "–" if isinstance(value, list) else str(value)


def headings(rows: Sequence[Row], part: Callable[[Row], Mapping[str, Any]]) -> list[str]:
    """Names in that part of the rows whose value is not the same in all of them."""
    names = dict.fromkeys(name for row in rows for name in part(row))
    return [name for name in names if any(part(row).get(name) != part(rows[0]).get(name) for row in rows)]


def table(benchmark: Benchmark) -> pages.Table:
    """Speed beside error, a line per row; what is the same in all rows goes into the caption."""
    rows = benchmark.rows
    sizes, told = headings(rows, lambda row: row.size), headings(rows, lambda row: row.told)
    errors = list(dict.fromkeys(name for row in rows for name in row.error))
    lines = []
    for place, row in enumerate(rows, start=1):
        times = ["–"] * 3
        if row.seconds:
            low, middle, high = (number(1e3 * seconds) for seconds in row.seconds)
            times = [middle, f"{low} – {high}", f"{_results.spread(row):.2f}"]
        values = [text(row.size.get(name)) for name in sizes]
        values += times + [number(row.error[name]) if name in row.error else "–" for name in errors]
        lines.append([str(place), row.what, *values, *(text(row.told.get(name)) for name in told)])
    header = ["#", "", *map(_title, sizes), "ms", "q1 – q3", "spread ×", *map(_title, errors), *map(_title, told)]
    same = {name: value for name, value in rows[0].size.items() if name not in sizes} if rows else {}
    caption = "; ".join(f"{_title(name)} {text(value)}" for name, value in same.items())
    return pages.Table(caption or "All settings are in the table.", [("", len(header), False)], header, lines, labels=2)


def _title(name: str) -> str:
    return name.replace("_", " ")


def panels(benchmark: Benchmark, shown: View) -> list[tuple[str, list[_pareto.Point]]]:
    """Rows that can be drawn, by panel; a panel of one point has nothing to compare and is left out."""
    groups: dict[str, list[tuple[int, Row, float]]] = {}
    for place, row in enumerate(benchmark.rows, start=1):
        value = shown.value(row)
        if row.seconds and value is not None and value >= 0 and shown.keep(row):
            known = {"what": row.what, **row.size}
            title = ", ".join(
                str(known[name]) if name == "what" else f"{_title(name)} {text(known.get(name))}"
                for name in shown.panels
            )
            groups.setdefault(title, []).append((place, row, value))
    found = []
    for title, members in groups.items():
        names = [name for name in headings([row for _, row, _ in members], lambda row: row.size)]
        points = [
            _pareto.Point(place, _name(row, names, shown), row.seconds[1], value)
            for place, row, value in members
            if row.seconds
        ]
        if len(points) > 1 and any(point.error > 0 for point in points):
            found.append((title, points))
    return found


def _name(row: Row, names: Sequence[str], shown: View) -> str:
    """Of a point: what it is, and the settings that differ within its panel."""
    settings = ", ".join(f"{_title(name)} {text(row.size.get(name))}" for name in names if row.size.get(name))
    return settings if "what" in shown.panels else ", ".join(filter(None, (row.what, settings)))


def section(benchmark: Benchmark, files: dict[str, bytes], pictures: Sequence[str]) -> pages.Section:
    """Sentence, machine, picture, table; the picture is added to `files`. pictures: drawn by the benchmark itself."""
    versions = ", ".join(f"{name} {version}" for name, version in benchmark.versions.items())
    threads = f"{benchmark.threads} thread{'s' if benchmark.threads > 1 else ''}"
    took = "" if benchmark.took_s is None else f"; {benchmark.took_s:.0f} s in all"
    blocks: list[Any] = [
        about(benchmark.name),
        f"{benchmark.cpu}, {benchmark.cores} cores, {threads}; {versions}{took}.",
    ]
    shown = view(benchmark)
    drawn = panels(benchmark, shown) if shown else []
    if shown and drawn:
        name = f"{benchmark.name}_pareto.png"
        files[name] = _pareto.draw(drawn, shown.label)
        caption = "Left and below is better. Numbers are those of the table's lines; the line is the frontier."
        blocks.append(pages.Figure(name, caption, f"{_title(benchmark.name)}: milliseconds against {shown.label}"))
    if f"{benchmark.name}.png" in pictures:
        caption = "How the time grows with the size of the task."
        blocks.append(pages.Figure(f"{benchmark.name}.png", caption, f"{_title(benchmark.name)}: growth"))
    return pages.Section(_title(benchmark.name).capitalize(), [*blocks, table(benchmark)])


def about(name: str) -> str:
    """First paragraph of the script's docstring."""
    docstring = ast.get_docstring(ast.parse((SCRIPTS / f"{name}.py").read_text(encoding="utf-8"))) or ""
    return " ".join(docstring.partition("\n\n")[0].split())


def cloud_sentence(benchmark: Benchmark) -> str | None:
    """n_v and N_H against F(τ), both averaged over the categories."""
    settings: dict[str, list[Row]] = {}
    for row in benchmark.rows:
        if row.seconds:
            settings.setdefault(str(sorted(row.size.items())), []).append(row)
    if not settings:
        return None
    rows = [members[0] for members in settings.values()]
    seconds = [statistics.mean(row.seconds[1] for row in members if row.seconds) for members in settings.values()]
    scores = [statistics.mean(row.error["f_score_tau_x100"] for row in members) for members in settings.values()]
    best = _results.frontier([(s, -f) for s, f in zip(seconds, scores, strict=True)])
    told = [_cloud_words(rows[i], seconds[i], scores[i]) for i in (best[0], best[-1])]
    plain = [
        i
        for i, row in enumerate(rows)
        if (row.size["num_directions"], row.size["cycles"]) == PAPER_CLOUD
        and not any(row.size.get(name) for name in CLOUD_DEPARTURES)
    ]
    words = f"of {len(rows)} settings {len(best)} are on the frontier, from {told[0]} to {told[1]}"
    if plain:
        words += f"; the paper's way is {_cloud_words(rows[plain[0]], seconds[plain[0]], scores[plain[0]])}"
    return f"**Point clouds**, {text(rows[0].size['points'])} points, means over the categories: {words}."


def _cloud_words(row: Row, seconds: float, score: float) -> str:
    extras = [name for name in CLOUD_DEPARTURES if row.size.get(name)]
    cycles = f"{row.size['cycles']} cycle{'s' if row.size['cycles'] > 1 else ''}"
    how = " with ".join(
        [f"{row.size['num_directions']} directions and {cycles}", *filter(None, [" and ".join(extras)])]
    )
    return f"{how} ({number(seconds)} s, F(τ) × 100 = {score:.1f})"


def inference_sentence(benchmark: Benchmark) -> str | None:
    """Width, precision and runtime against the error of depth."""
    rows = [row for row in benchmark.rows if row.seconds and _values_only(row) and "depth_mean" in row.error]
    if not rows:
        return None
    parts = []
    for width in sorted({row.size["width"] for row in rows}):
        group = [row for row in rows if row.size["width"] == width]
        full = [row for row in group if row.told.get("precision") == "float32"] or group
        chosen = {row.key: row for row in (_fastest(full), _fastest(group))}
        told = [_inference_words(row) for row in chosen.values()]
        parts.append(f"width {width}: {' against '.join(told)}")
    return f"**Fields**, fastest in float32 against fastest of all: {'; '.join(parts)}."


def _fastest(rows: Sequence[Row]) -> Row:
    return min(rows, key=lambda row: row.seconds[1] if row.seconds else float("inf"))


def _inference_words(row: Row) -> str:
    rate = row.size["rays"] / row.seconds[1] / 1e6 if row.seconds else float("nan")
    return f"{row.what} ({number(rate)} million rays/s, mean error of depth {number(row.error['depth_mean'])})"


def rendering_sentence(benchmark: Benchmark) -> str | None:
    """The DDF against sphere tracing that is as good, and against casting the mesh."""
    rows = [row for row in benchmark.rows if row.seconds and "times_ddf" in row.told]
    own = next((row for row in rows if row.what == "DDF"), None)
    if own is None or not own.seconds:
        return None
    rivals = [row for row in rows if row.what.startswith("sphere tracing")]
    equal = next((row for row in rows if row.told.get("fastest_as_good_as_ddf")), None)
    words = "no sphere tracing of a network of the same size is as good"
    if equal:
        words = f"the fastest as good, {_rendering_words(equal)}, takes {number(equal.told['times_ddf'])} times as long"
    elif rivals:
        nearest = min(rivals, key=lambda row: row.error["depth_median"])
        words += f"; nearest comes {_rendering_words(nearest)}, {number(nearest.told['times_ddf'])} times as long"
    refined = next((row for row in rows if row.what == "DDF, refined"), None)
    if refined:
        words += f"; {_rendering_words(refined)}"
    if refined and refined.seconds and equal and equal.seconds:
        words += f", of which that is {number(equal.seconds[1] / refined.seconds[1])} times"
    casting = next((row for row in rows if row.what == "mesh casting"), None)
    last = f"; {_rendering_words(casting)}" if casting else ""
    return f"**Rendering**, {own.size['pixels_a_side']} pixels a side: {_rendering_words(own)}; {words}{last}."


def _rendering_words(row: Row) -> str:
    time = number(1e3 * row.seconds[1]) if row.seconds else "–"
    return f"{row.what} ({time} ms, median error of depth {number(row.error['depth_median'])})"


_FITS = "../fit_proof/README.md"
OWN_PAGES = {
    "fit_curves": _FITS,
    "fit_options": _FITS,
    "growth": "../growth.md",
    "primitive_fits": _FITS,
}  # benchmarks whose findings are no rows of seconds and errors

FIRST: Mapping[str, Callable[[Benchmark], str | None]] = {
    "cloud_sampling": cloud_sentence,
    "field_inference": inference_sentence,
    "rendering": rendering_sentence,
}


def page(found: Mapping[str, Benchmark], pictures: Sequence[str] = ()) -> pages.Page:
    """The trade-offs that matter most, then every benchmark by name.

    Args:
      pictures: names of files that benchmarks drew themselves.
    """
    files: dict[str, bytes] = {}
    ordered = [*(name for name in FIRST if name in found), *(name for name in found if name not in FIRST)]
    sections = [section(found[name], files, pictures) for name in ordered if name not in OWN_PAGES]
    sentences = [sentence for name in FIRST if name in found and (sentence := FIRST[name](found[name]))]
    figures = [block for part in sections[: len(sentences)] for block in part.blocks if _is_pareto(block)]
    lead = [
        'Made by `make bench` (`make bench BENCH="evaluation rendering"` runs some). Times are medians; a second run '
        "on the same machine has its medians within the factor `spread` of them, but for one in a hundred, once the "
        "factor that all rows of a benchmark share is taken off; `make bench-check` tries it. Spread follows from "
        "quartiles and number of samples, and from what differs from run to run (`bench/_results.py`).",
        *_elsewhere(found),
    ]
    first = [pages.Section("What matters most", [*([tuple(sentences)] if sentences else []), *figures])]
    if not sentences:
        first = []
    shown = {block.name for block in figures}
    kept = [pages.Section(s.title, [b for b in s.blocks if getattr(b, "name", None) not in shown]) for s in sections]
    return pages.Page(TITLE, lead, [*first, *kept], files)


def _elsewhere(found: Mapping[str, Benchmark]) -> list[str]:
    """A line with the pages of `OWN_PAGES`, or none."""
    titles: dict[str, list[str]] = {}
    for name, link in OWN_PAGES.items():
        if name in found:
            titles.setdefault(link, []).append(_title(name))
    links = [f"[{', '.join(names)}]({link})" for link, names in titles.items()]
    return [f"On pages of their own: {'; '.join(links)}."] if links else []


def _is_pareto(block: Any) -> bool:
    return isinstance(block, pages.Figure) and block.name.endswith("_pareto.png")


def main() -> None:
    """Write the page and its pictures beside the results."""
    made = page(_results.load_folder(_measure.OUT), [file.name for file in _measure.OUT.glob("*.png")])
    for name, data in made.files.items():
        (_measure.OUT / name).write_bytes(data)
    (_measure.OUT / "README.md").write_text(pages.markdown(made), encoding="utf-8")
    print(_measure.OUT / "README.md")


if __name__ == "__main__":
    raise SystemExit(stage.guarded(main, "bench"))
