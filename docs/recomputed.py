"""Every number, bold cell and "better" of the reports' tables of models, from the committed scores per image alone.

`python docs/recomputed.py` lists the pages, those without per_image.csv too. Nothing of the package is used:
means, standard errors, Student's t and Holm's correction are written down here a second time.
"""

import functools
import itertools
import re
import sys
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import TypeVar

import numpy as np
import pandas as pd
from scipy import stats

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted(page for page in (ROOT / "reports").glob("*/") if (page / "si3dr.csv").is_file())
OPEN = [page for page in PAGES if (page / "per_image.csv").is_file()]
METRICS = {  # as printed: score, factor, -1 where less is better
    "D<sub>C</sub> ↓": ("chamfer_l2_sq", 1000, -1),
    "F<sub>τ</sub> ↑": ("f_score_tau", 100, 1),
    "F<sub>2τ</sub> ↑": ("f_score_2tau", 100, 1),
    "precision ↑": ("precision_tau", 100, 1),
    "recall ↑": ("recall_tau", 100, 1),
    "unevenness ↓": ("spacing_variation", 1, -1),
}
CLAIMED = ("D<sub>C</sub> ↓", "F<sub>τ</sub> ↑")
MODELS = {"DDF": "ddf", "PC-SIREN": "pc_siren", "DDF+image": "ddf_image"}
METHODS = MODELS | {f"{name}×3": f"{method}_3views" for name, method in MODELS.items()}
METHODS |= {"as encoded": "ddf", "on the mask": "ddf_on_mask", "once": "ddf_nh1", "3 times": "ddf"}
ROWS = MODELS | {"retrieval": "retrieval", "mean shape": "mean_shape"}  # of the table of baselines: who competes
ALONE = {"ceiling": "ceiling", "oracle retrieval": "oracle_retrieval"}  # and who does not
CAMERAS = {"Π<sub>g</sub>": "Pi_g", "Π̂<sub>∇</sub>": "Pi_corrected", "Π̂": "Pi_pred"}
Cell = tuple[str, str, str, str]  # category, method, column, metric
Key = TypeVar("Key")


def chance(gap: float, error: float, freedom: float) -> float:
    """Of a gap so far from 0 where there is none: Student's t, two-sided."""
    return float(2 * stats.t.sf(abs(gap) / error, freedom))


def held(chances: Mapping[Key, float]) -> set[Key]:
    """Those that Holm's correction leaves, at 5 %."""
    ranked, left = sorted(chances, key=chances.__getitem__), set[Key]()
    for number, key in enumerate(ranked):
        if chances[key] > 0.05 / (len(ranked) - number):
            break
        left.add(key)
    return left


class Scores:
    """Of a page's per_image.csv: by category, method and column, trainings by shapes."""

    def __init__(self, folder: Path) -> None:
        table = pd.read_csv(folder / "per_image.csv", dtype={"id": str})
        self.groups = dict(list(table.groupby(["category", "method", "column"])))

    @functools.cache  # noqa: B019 of one page
    def of(self, cell: Cell) -> tuple[np.ndarray, float]:
        """Means of shapes, a training in a row, and the mean over images and trainings, both as printed."""
        *head, metric = cell
        score, factor, _ = METRICS[metric]
        rows = self.groups[tuple(head)]
        shapes = rows.pivot_table(index="training", columns="id", values=score, aggfunc="mean", dropna=False)
        return factor * shapes.to_numpy(), factor * float(rows.groupby("training")[score].mean().mean())

    def gap(self, one: Cell, two: Cell) -> tuple[float, float, float]:
        """By how much the first is better, its standard error, and the degrees of freedom of that."""
        first, second = self.of(one)[0], self.of(two)[0]
        paired = first.mean(0) - second.mean(0)
        terms = [(paired.var(ddof=1) / paired.size, paired.size - 1)]
        terms += [(own.mean(1).var(ddof=1) / len(own), len(own) - 1) for own in (first, second) if len(own) > 1]
        variance = sum(term for term, _ in terms)
        freedom = variance**2 / sum(term**2 / degrees for term, degrees in terms)
        return METRICS[one[3]][2] * paired.mean(), np.sqrt(variance), freedom

    def better(self, pairs: set[tuple[Cell, Cell]]) -> set[tuple[Cell, Cell]]:
        """Those pairs that Holm's correction leaves, the better cell first."""
        gaps = {pair: self.gap(*pair) for pair in pairs}
        left = held({pair: chance(*gap) for pair, gap in gaps.items()})
        return {(one, two) if gaps[one, two][0] > 0 else (two, one) for one, two in left}

    def verdicts(self, cells: Collection[Cell]) -> dict[Cell, int]:
        """Of a table's cells: 1 for what is claimed to be better than all others beside it, -1 for worse, else 0."""
        rivals = [cell for cell in cells if cell[2].endswith("-L") and cell[3] in CLAIMED]
        rivals = [cell for cell in rivals if cell[1] not in ALONE.values()]
        alike = [pair for pair in itertools.combinations(rivals, 2) if all(pair[0][i] == pair[1][i] for i in (0, 2, 3))]
        better, found = self.better(set(alike)), dict[Cell, int]()
        for cell in cells:
            others = [one if two == cell else two for one, two in alike if cell in (one, two)]
            won = all((cell, other) in better for other in others)
            lost = all((other, cell) in better for other in others)
            found[cell] = won - lost  # of no others both
        return found

    def told(self, cell: Cell, way: int = 1) -> str:
        """Over the best of the other models (way -1: under the worst): how much, its interval of 95 %, of how many
        shapes and trainings.
        """
        others = [(cell[0], method, *cell[2:]) for method in MODELS.values() if method != cell[1]]
        pairs = [(cell, other)[::way] for other in others if other[:3] in self.groups]
        gap, error, freedom = min(self.gap(*pair) for pair in pairs)
        trainings, shapes = self.of(cell)[0].shape
        digits = 1 if METRICS[cell[3]][1] == 100 else 3
        of = f"{shapes} shapes, {trainings} training{'s' if trainings > 1 else ' alone'}"
        return f"by {gap:.{digits}f} ± {stats.t.ppf(0.975, freedom) * error:.{digits}f}, {of}"


def tables(text: str) -> Iterator[dict[Cell, str]]:
    """Of every table of scores of a page its cells as printed; quoted ones of the paper are left out."""
    blocks = text.split("\n\n")
    for block, after in itertools.pairwise(blocks):
        if not block.startswith("|  | ") or after.startswith("*The paper's numbers"):
            continue
        header, _, *lines = ([cell.strip() for cell in line.strip("|").split(" | ")] for line in block.splitlines())
        cells, category = {}, ""
        for first, label, *values in lines:
            category = first or category
            camera, _, size = label.partition("-")
            for name, value in zip(header[2:], values, strict=True):
                method = next((each for each in METHODS if name.endswith(f" {each}")), "")
                metric = name.removesuffix(f" {method}")
                if header[1] == "camera, points" and metric in METRICS:
                    cells[category, METHODS[method], f"{CAMERAS[camera]}-{size}", metric] = value
                elif name in METRICS and label in ROWS | ALONE:
                    cells[category, (ROWS | ALONE)[label], "Pi_g-L", name] = value
        if cells := {cell: value for cell, value in cells.items() if value != "–"}:
            yield cells


def wrong(folder: Path) -> list[str]:
    """What a page says and its scores per image do not."""
    scores, text, found = Scores(folder), (folder / "README.md").read_text(encoding="utf-8"), list[str]()
    for cells in tables(text):
        for cell, value in cells.items():
            said = value.strip("*").partition(" ± ")[0]
            half = 0.5 * 10.0 ** -len(said.partition(".")[2])
            if abs(float(said) - (mean := scores.of(cell)[1])) > 1.01 * half + 1e-4 * abs(mean):
                found.append(f"{cell}: {value} is printed, {mean:.5g} measured")
        for cell, verdict in scores.verdicts(cells).items():
            if (verdict > 0) != cells[cell].startswith("**"):
                found.append(f"{cell}: {cells[cell]} should {'' if verdict > 0 else 'not '}be bold")
    return found + [f"{line!r} is not said" for line in said_of(text) if line not in text]


def said_of(text: str) -> Iterator[str]:
    """The sentences of the verdict."""
    first = next(tables(text))
    categories = list(dict.fromkeys(cell[0] for cell in first))
    for where, column in (("true", "Pi_g-L"), ("predicted", "Pi_pred-L")):
        said = []
        for name, method in MODELS.items():
            won = [
                f"{category} ({' and '.join(metrics)})"
                for category in categories
                if (
                    metrics := [
                        metric[:-2]
                        for metric in CLAIMED
                        if first.get((category, method, column, metric), "").startswith("**")
                    ]
                )
            ]
            said += [f"{name} is best for {_listed(won)}"] if won else []
        yield f"With the {where} camera, {'; '.join(said)}" if said else f"With the {where} camera, no model is better"


def _listed(names: list[str]) -> str:
    return re.sub(r", ([^,]*)$", r" and \1", ", ".join(names))


if __name__ == "__main__":
    for page in PAGES:
        told = wrong(page) if page in OPEN else ["no per_image.csv yet: nothing is recomputed"]
        sys.stdout.write(f"{page.relative_to(ROOT)}: {'; '.join(told) or 'all agree'}\n")
