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

from ddf.pipeline import stage
from ddf.report import pages

SCRIPTS = Path(__file__).resolve().parent
TITLE = "Speed against error"
PAPER_CLOUD = (128, 3)  # n_v and N_H of [DDF22]
CLOUD_DEPARTURES = ("jitter", "recheck", "spread")  # from it


def _milliseconds(row: Row) -> float:
    """Of a row that was timed."""
    return 1e3 * row.seconds[1] if row.seconds else float("nan")


@dataclass(frozen=True)
class View:
    """What one or more panels of a benchmark's picture show.

    error: key of the error drawn. label: its axis. panels: keys of `size` (or `what`) that rows of one panel share, or
    what tells its title. best: for scores that are better when higher, the score that nothing exceeds; best - score is
    drawn. keep: rows that can be compared at all. cost, cost_label: what a row takes, small is good.
    """

    error: str
    label: str
    panels: tuple[str, ...] | Callable[[Row], str] = ()
    best: float | None = None
    keep: Callable[[Row], bool] = lambda _: True
    cost: Callable[[Row], float] = _milliseconds
    cost_label: str = "ms"

    def value(self, row: Row) -> float | None:
        """The error drawn; None where the row has none."""
        value = row.error.get(self.error)
        if value is None or self.best is None:
            return value
        return self.best - value

    def title(self, row: Row) -> str:
        """Of the panel that a row belongs to."""
        if callable(self.panels):
            return self.panels(row)
        known = {"what": row.what, **row.size}
        words = (
            str(known[name]) if name == "what" else f"{_title(name)} {text(known.get(name))}" for name in self.panels
        )
        return ", ".join(words)


def _values_only(row: Row) -> bool:
    """Rows of one batch with all threads, without normals."""
    return "normals" not in row.size.get("outputs", ("normals",)) and row.size.get("threads", 1) > 1


def _samples_on_one_core(row: Row) -> bool:
    """Rows of the samples of a shape, not of its cloud."""
    return "counts" in row.size and row.size.get("threads") == 1


def _of_networks(row: Row) -> bool:
    """Images of the compared size, but for the mesh itself, which takes a small part of the time at no error."""
    return "times_ddf" in row.told and row.what != "mesh casting"


def _stored(error: str, label: str) -> View:
    """Bytes of a sample against an error; decoding has the same."""
    return View(
        error,
        label,
        lambda _: label.partition(",")[0],
        keep=lambda row: row.what.startswith("encode"),
        cost=lambda row: row.size["bytes_per_sample"],
        cost_label="bytes a sample",
    )


VIEWS: Mapping[str, tuple[View, ...]] = {
    "cloud_sampling": (View("f_score_tau_x100", "points missed: 100 - 100 F(τ)", ("what",), best=100.0),),
    "composition": (),  # ways with the same error: their growth is drawn
    "derivatives": (View("relative_p999", "error over the median value, 99.9 %", ("quantity",)),),
    "evaluation": (View("chamfer_relative", "relative error of D_C"),),
    "field_inference": (View("depth_mean", "mean error of depth", ("width",), keep=_values_only),),
    "full_size_step": (),  # steps of two models, which are no alternatives
    "ray_casting": (
        View(
            "depth_median",
            "median error of depth",
            ("rays",),
            cost=lambda row: 1e3 * _milliseconds(row) / row.size["count"],
            cost_label="µs a ray",
        ),
    ),
    "rendering": (View("depth_median", "median error of depth", keep=_of_networks),),
    "sample_extraction": (
        View("position_shift", "shift of a stored position", ("shape", "counts"), keep=_samples_on_one_core),
    ),
    "si3dr_options": (
        View(
            "chamfer_l2_sq_x1000",
            "1000 D_C",
            lambda _: "clouds of an image, model of base",
            keep=lambda row: not row.told.get("steps"),  # trainings take the same time, by design
        ),
    ),
    "storage": (
        _stored("position_max", "position, field units, largest error"),
        _stored("direction_deg_max", "direction, degrees, largest error"),
        _stored("depth_max", "depth, field units, largest error"),
        _stored("normal_deg_max", "normal, degrees, largest error"),
    ),
    "training_step": (View("gradient_relative", "relative error of the gradient", ("hidden",)),),
}


def views(benchmark: Benchmark) -> tuple[View, ...]:
    """Of a benchmark: those of `VIEWS`, or its first error that is positive somewhere; none where there is none."""
    if benchmark.name in VIEWS:
        return VIEWS[benchmark.name]
    names = dict.fromkeys(name for row in benchmark.rows for name in row.error)
    found = next((name for name in names if any(row.error.get(name, 0.0) > 0 for row in benchmark.rows)), None)
    return () if found is None else (View(found, found.replace("_", " ")),)


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


def panels(benchmark: Benchmark, shown: View) -> list[_pareto.Panel]:
    """Rows that can be drawn, by panel; a panel of one point has nothing to compare and is left out."""
    groups: dict[str, list[tuple[int, Row, float]]] = {}
    for place, row in enumerate(benchmark.rows, start=1):
        value = shown.value(row)
        if row.seconds and value is not None and value >= 0 and shown.keep(row):
            groups.setdefault(shown.title(row), []).append((place, row, value))
    found = []
    for title, members in groups.items():
        told_apart = len({row.what for _, row, _ in members}) == len(members)
        names = [] if told_apart else headings([row for _, row, _ in members], lambda row: row.size)
        points = [
            _pareto.Point(place, _name(row, names, shown), shown.cost(row), value) for place, row, value in members
        ]
        if len(points) > 1 and any(point.error > 0 for point in points):
            found.append(_pareto.Panel(title, shown.label, shown.cost_label, points))
    return found


def _name(row: Row, names: Sequence[str], shown: View) -> str:
    """Of a point: what it is, and the settings that differ within its panel."""
    settings = ", ".join(f"{_title(name)} {text(row.size.get(name))}" for name in names if row.size.get(name))
    by_what = not callable(shown.panels) and "what" in shown.panels
    return settings if by_what and settings else ", ".join(filter(None, (row.what, settings)))


def section(benchmark: Benchmark, files: dict[str, bytes], pictures: Sequence[str]) -> pages.Section:
    """Sentence, machine, picture, table; the picture is added to `files`. pictures: drawn by the benchmark itself."""
    versions = ", ".join(f"{name} {version}" for name, version in benchmark.versions.items())
    threads = f"{benchmark.threads} thread{'s' if benchmark.threads > 1 else ''}"
    took = "" if benchmark.took_s is None else f"; {benchmark.took_s:.0f} s in all"
    blocks: list[Any] = [
        about(benchmark.name),
        f"{benchmark.cpu}, {benchmark.cores} cores, {threads}; {versions}{took}.",
    ]
    if benchmark.name in NOTES and (note := NOTES[benchmark.name](benchmark)):
        blocks.append(note)
    drawn = [panel for shown in views(benchmark) for panel in panels(benchmark, shown)]
    if drawn:
        name = f"{benchmark.name}_pareto.png"
        files[name] = _pareto.draw(drawn)
        caption = "Left and below is better. Numbers are those of the table's lines; the line is the frontier."
        axes = "; ".join(dict.fromkeys(f"{panel.cost} against {panel.error}" for panel in drawn))
        blocks.append(pages.Figure(name, caption, f"{_title(benchmark.name)}: {axes}"))
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
    """The DDF, of every pixel and refined, against sphere tracing that is as good, and against casting the mesh."""
    rows = [row for row in benchmark.rows if row.seconds and "times_ddf" in row.told]
    own = next((row for row in rows if row.what == "DDF"), None)
    if own is None:
        return None
    refined = next((row for row in rows if row.what == "DDF, refined"), None)
    casting = next((row for row in rows if row.what == "mesh casting"), None)
    rivals = [row for row in rows if row.what.startswith("sphere tracing")]
    parts = [_against(own, [row for row in rivals if not row.what.endswith("refined")])]
    if refined:
        parts.append(_against(refined, rivals))
    if casting:
        parts.append(_rendering_words(casting))
    return f"**Rendering**, {own.size['pixels_a_side']} pixels a side: {'; '.join(parts)}."


def _against(own: Row, rivals: Sequence[Row]) -> str:
    """A way of drawing, and the fastest of `rivals` whose depth and visibility are as good."""
    good = [
        row
        for row in rivals
        if all(row.error[name] <= own.error[name] for name in ("depth_median", "wrong_visibility"))
    ]
    words = _rendering_words(own)
    if good:
        best = _fastest(good)
        return f"{words}, the fastest tracing as good, {_rendering_words(best)}, {_times(best, own)} times as long"
    words += ", no sphere tracing of a network of the same size as good"
    if not rivals:
        return words
    nearest = min(rivals, key=lambda row: row.error["depth_median"])
    return f"{words}, nearest {_rendering_words(nearest)}, {_times(nearest, own)} times as long"


def _times(row: Row, other: Row) -> str:
    return number(row.seconds[1] / other.seconds[1]) if row.seconds and other.seconds else "–"


def _rendering_words(row: Row) -> str:
    time = number(1e3 * row.seconds[1]) if row.seconds else "–"
    return f"{row.what} ({time} ms, median error of depth {number(row.error['depth_median'])})"


def extraction_note(benchmark: Benchmark) -> str | None:
    """What a shape's samples take, file written, over Open3D's casting alone."""
    found: dict[int, list[str]] = {}
    for row in benchmark.rows:
        if row.what == "samples, file written":
            same = [
                each for each in benchmark.rows if each.size == row.size and each.what == "Open3D alone, scene built"
            ]
            words = f"{row.size['shape']} ({row.size['counts']}) {_times(row, same[0])}" if same else ""
            found.setdefault(row.size["threads"], []).append(words)
    parts = [f"on {cores} core{'s' if cores > 1 else ''} {', '.join(words)}" for cores, words in found.items()]
    if not parts:
        return None
    return (
        "Samples of a shape, file written, as a multiple of Open3D's time for the same rays, its scene built: "
        f"{'; '.join(parts)}. The goal is at most 2."
    )


def runtimes_note(benchmark: Benchmark) -> str | None:
    """onnxruntime over the fastest of torch's ways, in float32."""
    parts = []
    for outputs in (["visibility", "depth"], ["visibility", "depth", "normals"]):
        rows = [row for row in benchmark.rows if row.seconds and row.size.get("outputs") == outputs]
        full = [row for row in rows if row.told.get("precision") == "float32"]
        words = []
        for width in sorted({row.size["width"] for row in full}):
            sides = [
                [row for row in full if row.size["width"] == width and (row.told["runtime"] == "onnxruntime") == onnx]
                for onnx in (True, False)
            ]
            words.append(f"{_times(*map(_fastest, sides))} (width {width})")
        if words:
            parts.append(f"{' and '.join((', '.join(outputs[:-1]), outputs[-1]))}: {', '.join(words)}")
    if not parts:
        return None
    return (
        "The fastest way of onnxruntime as a multiple of the time of the fastest way of torch, float32, two threads: "
        f"{'; '.join(parts)}. The goal is at most 1."
    )


NOTES: Mapping[str, Callable[[Benchmark], str | None]] = {
    "field_inference": runtimes_note,
    "sample_extraction": extraction_note,
}  # what a benchmark's rows say of its goal

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
    shown = {block.name for block in figures if isinstance(block, pages.Figure)}
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
