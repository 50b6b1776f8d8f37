"""Results: both models in the columns of the paper's table `si3dr`, a verdict from them, the paper's numbers."""

import math
from collections.abc import Mapping

import numpy as np
import pandas as pd

from ddf.evaluation import baselines, metrics, paper_results, scoring
from ddf.report.experiment import scores, seed_notes
from ddf.report.experiment.stage_results import Results
from ddf.report.pages import Block, Section, Table, paragraph

MODELS = ((scores.METHOD_LABELS[scoring.DDF], scoring.DDF), (scores.METHOD_LABELS[scoring.PC_SIREN], scoring.PC_SIREN))
COLUMNS = ("Pi_g-L", "Pi_g-S", "Pi_corrected-S", "Pi_pred-L", "Pi_pred-S")
_VERDICTS = (("With the true camera", "Pi_g-L"), ("With the predicted camera", "Pi_pred-L"))
_CHAMFER = "chamfer_l2_sq_x1000"
_SEEN = 2.0  # standard errors that a difference must exceed to be called one
_CAPTION = "Single-image reconstruction, measured here. Means over images. Bold: the better model of a row."
_PAPER = "The paper's numbers on ShapeNet: other data and other sizes, not comparable cell by cell."
_QUOTED = "The same, of P2M and 3DR. The paper takes them from Pixel2Mesh; they predict in the frame of the view."
_READING = (
    "D<sub>C</sub>: Chamfer distance × 1000, the sum of both means of squared distances.",
    "F<sub>τ</sub>: F-score × 100 at squared distance ≤ τ = {tau}; F<sub>2τ</sub>: at twice that.",
    "Lengths are in benchmark units, 0.57 × v1.",
    "L and S: {large} and {small} predicted points, against the whole true cloud.",
    "Π<sub>g</sub>: true camera. Π̂: predicted camera and estimated scale.",
    "Π̂<sub>∇</sub>: predicted camera after gradient descent on the mask.",
    "The first sentences of the page compare D<sub>C</sub> with L points.",
    "A difference is called one where it exceeds two of its standard errors over {over}.",
)
_SILHOUETTES = (
    "Before its clouds are drawn, a shape of DDF moves until its silhouette from the predicted camera agrees with the "
    "image's alpha channel. PC-SIREN has no visibility to do so with."
)


def verdict(results: Results) -> str:
    """Which model has the smaller Chamfer distance, with either camera, in two sentences."""
    return " ".join(_sentence(where, better_model(results, column)) for where, column in _VERDICTS)


def better_model(results: Results, column: str) -> dict[str, str]:
    """By category the model whose D_C is smaller, empty where the difference is not larger than two standard errors.

    The variance of the difference is that of its mean over test shapes (first seed, images of a shape taken together)
    plus, of several seeds, those of both means over seeds.
    """
    table = scores.Scores(results.table)
    found = {}
    for category in results.categories:
        heads = [(method, column) for _, method in MODELS]
        ours, theirs = (table.value(category, head, _CHAMFER) for head in heads)
        if ours is None or theirs is None:
            continue
        spreads = [table.seeds_spread(category, head, _CHAMFER) for head in heads]
        variance = _shape_variance(results.per_image, category, column) + sum(s**2 for s in spreads) / results.seeds
        seen = abs(ours - theirs) > _SEEN * math.sqrt(variance)  # of one shape: NaN, not seen
        found[category] = MODELS[int(theirs < ours)][0] if seen else ""
    return found


def _shape_variance(per_image: pd.DataFrame, category: str, column: str) -> float:
    """Of the mean over test shapes of 1000 (D_C of DDF - D_C of PC-SIREN), by the spread over shapes."""
    rows = per_image[(per_image["category"] == category) & (per_image["column"] == column)]
    by_method = rows.pivot(index=["id", "view"], columns="method", values="chamfer_l2_sq")
    gaps = 1000.0 * (by_method[scoring.DDF] - by_method[scoring.PC_SIREN]).groupby("id").mean().to_numpy()
    return float(np.var(gaps, ddof=1) / len(gaps)) if len(gaps) > 1 else math.nan


def _sentence(where: str, found: Mapping[str, str]) -> str:
    parts = []
    for model, _ in MODELS:
        won = [category for category, better in found.items() if better == model]
        parts += [f"{model} is closer to the truth for {_listed(won)}"] if won else []
    even = [category for category, better in found.items() if not better]
    parts += [f"no difference between the models is seen for {_listed(even)}"] if even else []
    return f"{where}, {'; '.join(parts)}." if parts else f"{where}, nothing was compared."


def _listed(names: list[str]) -> str:
    return " and ".join(", ".join(names).rsplit(", ", 1))


def section(results: Results) -> Section:
    """Our table, what follows from it, how to read it, the paper's table."""
    caption = seed_notes.over_seeds(results, _CAPTION)
    blocks: list[Block | None] = [
        scores.pairs(results.table, results.categories, COLUMNS, MODELS, caption),
        tuple(findings(results)),
        "How to read the tables:",
        reading(results),
        scores.pairs(results.table, results.categories, COLUMNS, MODELS, _PAPER, paper_results.SOURCE),
        quoted(results),
    ]
    return Section("Results", [block for block in blocks if block])


def findings(results: Results) -> list[str]:
    """What the table says, in sentences made from its numbers."""
    table = scores.Scores(results.table)
    found = []
    for label, method in MODELS:
        ratios = [
            f"{category} {mean / ours:.2f}"
            for category in results.categories
            if (ours := table.value(category, (method, "Pi_g-L"), _CHAMFER))
            and (mean := table.value(category, (baselines.MEAN_SHAPE, "Pi_g-L"), _CHAMFER))
        ]
        found.append(f"D<sub>C</sub> of the mean shape over that of {label} (true camera, L): {', '.join(ratios)}.")
    changes = []
    for category in results.categories:
        before, after = (
            table.value(category, (scoring.DDF, column), _CHAMFER) for column in ("Pi_pred-S", "Pi_corrected-S")
        )
        if before is not None and after is not None:
            changes.append(f"{category} {before:.3f} → {after:.3f}")
    corrected = f"D<sub>C</sub> of DDF (S) as the predicted camera is corrected by the mask: {', '.join(changes)}."
    return [*found, corrected] if changes else found


def reading(results: Results) -> tuple[str, ...]:
    """What columns and metrics are."""
    rows = results.per_image[results.per_image["method"] == scoring.PC_SIREN]
    large, small = (int(rows[rows["column"] == f"Pi_g-{size}"]["num_pred"].iloc[0]) for size in "LS")
    values = {
        "tau": results.setting("evaluate.tau_sq"),
        "large": f"{large:,}",
        "small": f"{small:,}",
        "over": "test shapes and seeds" if results.seeds > 1 else "test shapes",
    }
    told = [paragraph(text, **values) for text in _READING]
    moved = results.settings["pointclouds"]["shape_correction"] is not None
    return (*told, _SILHOUETTES) if moved else tuple(told)


def quoted(results: Results) -> Table | None:
    """P2M and 3DR, which were not run."""
    table = scores.Scores(results.table, paper_results.SOURCE)
    heads = [head for head in paper_results.SI3DR_COLUMNS if head[1] == "view frame"]
    rows = [
        [
            category if head == heads[0] else "",
            scores.METHOD_LABELS[head[0]],
            *(table.cell(category, head, metric) for metric in metrics.PRINTED),
        ]
        for category in results.paper_categories
        for head in heads
    ]
    header = ["", "", *(str(metric.label) for metric in metrics.PRINTED.values())]
    groups = [("", 2, False), ("", len(metrics.PRINTED), True)]
    return Table(_QUOTED, groups, header, rows, labels=2, rule_every=len(heads)) if rows else None
