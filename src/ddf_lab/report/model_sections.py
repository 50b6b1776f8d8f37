"""Sections of the models' scores: the columns of the paper, a verdict, baselines, shapes far from training."""

import itertools
from collections.abc import Mapping, Sequence

import pandas as pd

from ddf.metrics import cloud_scores
from ddf_lab.evaluation import baselines, claims, paper_results, scoring
from ddf_lab.report import figures, scores
from ddf_lab.report.pages import Cell, Figure, Section, Table
from ddf_lab.report.stage_results import Results

MODELS = tuple((scores.METHOD_LABELS[method], method) for method in (scoring.DDF, scoring.PC_SIREN, scoring.DDF_IMAGE))
COLUMNS = ("Pi_g-L", "Pi_g-S", "Pi_corrected-L", "Pi_corrected-S", "Pi_pred-L", "Pi_pred-S")
LARGE = ("Pi_g-L", "Pi_pred-L")
BASELINES = (
    baselines.CEILING,
    baselines.ORACLE,
    scoring.DDF_IMAGE,
    scoring.DDF,
    scoring.PC_SIREN,
    baselines.RETRIEVAL,
    baselines.MEAN_SHAPE,
)
_COMPETITORS = BASELINES[2:]
NEAR = 90  # F(τ) x 100 of a training shape that is a test shape's relative
_CHAMFER, _F_SCORE = "chamfer_l2_sq_x1000", "f_score_tau_x100"
_COMPARED = {_CHAMFER: "D<sub>C</sub>", _F_SCORE: "F<sub>τ</sub>"}
_ARROWS = {metric: scores.LABELS[metric] for metric in _COMPARED}
_JUDGED = scores.LABELS | {"spacing_variation": "unevenness ↓"}
_SHARES = {"precision_tau_x100": "precision ↑", "recall_tau_x100": "recall ↑"}
_NEEDED = (  # what is to be done for a column
    ("Π<sub>g</sub>, Π̂", ("encoders", "cloud")),
    ("Π̂<sub>∇</sub>", ("encoders", "cloud", "camera_correction")),
    ("shape moved to the mask", ("encoders", "shape_correction", "cloud")),
)
_READING = (
    "D<sub>C</sub>: Chamfer distance × 1000, the sum of both means of squared distances. F<sub>τ</sub>: F-score × 100 "
    "at squared distance ≤ τ = {tau:g}; F<sub>2τ</sub>: at twice that. Lengths: 0.57 × v1.",
    "L and S: {large:,} and {small:,} predicted points, against the whole true cloud.",
    "Π<sub>g</sub>: true camera; two models are told the scale, DDF+image reads the image by that "
    "camera. Π̂: predicted camera and estimated scale. Π̂<sub>∇</sub>: after gradient descent on the "
    "mask, which both encoders see; of DDF+image the azimuth by which its field is surest of the mask.",
    "Bold, in D<sub>C</sub> and F<sub>τ</sub> of L points alone: Student's t, their comparisons in a table corrected "
    "together (Holm, 5 %). Standard errors are over test shapes, paired, {over}.",
)


def verdict(table: Table) -> str:
    """Which model is better than the others, in what, with either camera, in two sentences: bold cells of the table."""
    where = {"With the true camera": LARGE[0], "With the predicted camera": LARGE[1]}
    return " ".join(_sentence(each, _best(table, scores.column_label(column))) for each, column in where.items())


def effects(results: Results, table: Table) -> Table:
    """By how much the best model of each mean is better than the next, its interval and the number of shapes."""
    scored, rows = [claims.by_head(each) for each in results.trainings], list[list[Cell | str]]()
    for category, column in itertools.product(results.groups, LARGE):
        cells, claimed, shapes = list[Cell | str](), _best(table, scores.column_label(column)), 0
        for metric, label in _COMPARED.items():
            own, least = cloud_scores.METRICS[metric], list[tuple[claims.Difference, str]]()
            sign = -1 if own.better == "min" else 1
            for one, first in MODELS:
                rivals = [(second, column) for two, second in MODELS if two != one]
                found = [claims.of_tables(scored, category, (first, column), rival, own) for rival in rivals]
                gaps = [gap for gap in found if gap]
                least += [(min(gaps, key=lambda gap: sign * gap.mean), one)] if gaps else []
            if least:
                gap, best = max(least, key=lambda pair: sign * pair[0].mean)
                shapes, by = gap.shapes, f"{sign * gap.mean:.{own.digits}f} ± {gap.half_interval:.{own.digits}f}"
                cells += [best, Cell(by, claimed.get((category, label)) == best)]
            else:
                cells += [scores.NOTHING] * 2
        camera = "true" if column == LARGE[0] else "predicted"
        rows.append([category if camera == "true" else "", camera, *cells, str(shapes)])
    header = ["", "camera", *(t for label in _COMPARED.values() for t in (f"{label}: best", "by")), "shapes"]
    trainings = f"{results.seeds} training{'s' if results.seeds > 1 else ''}"
    caption = (
        f"By how much the best model is better than the next one, ± half the 95 % interval over test shapes and "
        f"{trainings} of each. Bold: claimed. D<sub>C</sub>: squared distance to the nearest point, both ways, × 1000. "
        "F<sub>τ</sub>: share of points that are near, both ways, × 100."
    )
    return Table(caption, header, rows, labels=3)


def _best(table: Table, column: str) -> dict[tuple[str, str], str]:
    """By category and metric of a column's rows the model whose cell is bold, empty where none is."""
    found, category = dict[tuple[str, str], str](), ""
    for first, label, *cells in table.rows:
        category = str(first) or category
        for number, metric in enumerate(_COMPARED.values() if label == column else ()):
            own = zip(MODELS, cells[number * len(MODELS) :], strict=False)
            won = [name for (name, _), cell in own if isinstance(cell, Cell) and cell.best]
            found[category, metric] = "".join(won)
    return found


def _sentence(where: str, found: Mapping[tuple[str, str], str]) -> str:
    parts = []
    for model, _ in MODELS:
        won: dict[str, list[str]] = {}
        for (category, label), better in found.items():
            if better == model:
                won.setdefault(category, []).append(label)
        scores_of = [f"{category} ({' and '.join(labels)})" for category, labels in won.items()]
        parts += [f"{model} is best for {_listed(scores_of)}"] if won else []
    if "" in found.values():
        parts.append(f"{'elsewhere ' if parts else ''}no model is better than both others")
    return f"{where}, {'; '.join(parts)}." if parts else f"{where}, nothing was compared."


def _listed(names: list[str]) -> str:
    return " and ".join(", ".join(names).rsplit(", ", 1))


def results_section(results: Results) -> Section:
    """Both models in the paper's columns, what their scores are made of, and the paper's numbers."""
    caption = f"Means over images. Bold: better than all others of the line. {scores.images_note(results)}"
    on_mask = (("as encoded", scoring.DDF), ("on the mask", scoring.DDF_ON_MASK))
    blocks = [
        scores.pairs(results, results.groups, COLUMNS, MODELS, caption, labels=_ARROWS, spread=True),
        reading(results),
        scores.pairs(
            results,
            results.groups,
            LARGE[:1],
            MODELS,
            "What F<sub>τ</sub> is made of, × 100: predicted points near the truth, true points near the prediction.",
            labels=_SHARES,
        ),
        distribution(results),
        scores.pairs(
            results,
            results.groups,
            LARGE,
            on_mask,
            "DDF with shapes moved until their silhouettes from the predicted camera agree with the test image's "
            "alpha. PC-SIREN is given no such descent here.",
        )
        if (results.per_image["method"] == scoring.DDF_ON_MASK).any()
        else None,
        scores.pairs(
            results,
            results.groups,
            LARGE[:1],
            [(f"{name}×3", method + scoring.THREE_VIEWS) for name, method in MODELS],
            "From three images of a shape, true cameras. DDF+image takes all three as they are; "
            "the others, which know no cameras, get the mean of three latents. None was trained for it.",
            labels=_ARROWS,
        ),
        seconds(results),
        scores.pairs(
            results,
            results.categories,
            LARGE,
            MODELS[:2],
            "The paper's numbers on ShapeNet, other data and other sizes; all are in [si3dr.csv](si3dr.csv).",
            paper_results.SOURCE,
        ),
    ]
    return Section("Results", blocks)


def distribution(results: Results) -> Table:
    """F(τ) × 100 under which a tenth, a half and nine tenths of the images lie."""
    metric, rows = cloud_scores.METRICS[_F_SCORE], list[Sequence[str]]()
    for group in results.groups:
        found = [[claims.rows_of(t, group, (method, LARGE[1])) for t in results.trainings] for _, method in MODELS]
        shares = [metric.factor * pd.concat(own)[metric.score].quantile([0.1, 0.5, 0.9]) for own in found]
        rows.append([group, *(" / ".join(f"{share:.0f}" for share in own) for own in shares)])
    caption = "F<sub>τ</sub> × 100 under which 10, 50 and 90 % of the images lie: predicted camera, L points."
    return Table(caption, ["", *(name for name, _ in MODELS)], rows)


def reading(results: Results) -> tuple[str, ...]:
    """What columns and metrics are."""
    rows = results.per_image[results.per_image["method"] == scoring.PC_SIREN]
    large, small = (int(rows[rows["column"] == f"Pi_g-{size}"]["num_pred"].iloc[0]) for size in "LS")
    over = "of one training each: another training may differ"
    if results.seeds > 1:
        over = f"and over {results.seeds} trainings, unpaired"
    return tuple(text.format(tau=cloud_scores.TAU_SQ, large=large, small=small, over=over) for text in _READING)


def seconds(results: Results) -> Table | None:
    """Wall time that a test image takes, by what its columns need; None where the stage noted none."""
    rows = [
        [label, model, f"{sum(known[part] for part in parts):.2f}"]
        for label, parts in _NEEDED
        for model, _ in MODELS
        if all(part in (known := results.seconds.get(model, {})) for part in parts)
    ]
    caption = (
        "Wall time of a test image, mean over categories: encoding, descents and clouds of both sizes. Several images "
        f"at a time, {results.settings['train'].loop.threads} thread each."
    )
    return Table(caption, ["columns", "", "seconds"], rows, labels=2) if rows else None


def one_cycle_section(results: Results) -> Section:
    """Points projected once, N_H = 1, beside all cycles."""
    cycles = results.settings["pointclouds"].cloud.cycles
    methods = (("once", scoring.DDF_ONE_CYCLE), (f"{cycles} times", scoring.DDF))
    caption = (
        f"DDF with points projected onto the surface once, and {cycles} times (N<sub>H</sub>), each cloud with its own "
        "scale. The paper's table `si3dr1h` is in [si3dr.csv](si3dr.csv)."
    )
    return Section("One projection cycle", [scores.pairs(results, results.groups, ("Pi_g-L",), methods, caption)])


def baselines_section(results: Results) -> Section:
    """Ceiling, retrievals, all models and the mean shape at the true camera: what the numbers of the models mean."""
    reading = (
        "Ceiling: a random subset of the truth against all of it.",
        "Oracle retrieval knows the truth: the training shape with the smallest D<sub>C</sub>.",
        "Retrieval takes the shape of the training image whose feature is nearest.",
        "The mean shape is points of all training clouds together or one training shape, whichever is nearer to the "
        "validation shapes.",
    )
    lines = [
        scores.Line(scores.METHOD_LABELS[method], [((method, "Pi_g-L"), metric, None) for metric in _JUDGED])
        for method in BASELINES
    ]
    caption = (
        "True camera, L points. Bold: better than all others of the models, retrieval and the mean shape. Unevenness: "
        "standard deviation over mean of the distance from a point to the nearest other one; independent even points "
        "have 0.52 (Rayleigh). More rows and S points: [si3dr.csv](si3dr.csv)."
    )
    rivals = [(method, "Pi_g-L") for method in _COMPETITORS]
    table = scores.table(results, results.groups, lines, ["", *_JUDGED.values()], caption, rivals)
    return Section("Baselines and ceilings", [table, reading])


def nearest_section(results: Results) -> Section:
    """Where the models fail: test shapes by their nearest training shapes, and the numbers of each group."""
    found = {group: by_shape(results, group) for group in results.groups}
    dots = Figure(
        "nearest.svg",
        "A dot is a test shape and a model. Across: F(τ) of the training shape nearest to it. Up: F(τ) of the model, "
        "mean over its images. True camera, L points.",
        "scores of the models over the score of the nearest training shape, a dot for each test shape, by category",
        figures.score_dots(found, "nearest training shape, F(τ) × 100", "model, F(τ) × 100").encode(),
    )
    reading = (
        "A model that is only right near what it learned rises with the line: correlation near 1, few shapes above it."
    )
    return Section("Far from the training shapes", [dots, nearest_table(found), reading, relatives_table(found)])


def by_shape(results: Results, group: str) -> pd.DataFrame:
    """F(τ) × 100 of test shapes, mean over images and trainings: a column `nearest` and one of each model."""
    metric = cloud_scores.METRICS[_F_SCORE]

    def means(method: str) -> pd.Series:
        tables = [claims.rows_of(table, group, (method, "Pi_g-L")) for table in results.trainings]
        return metric.factor * pd.concat(tables).groupby("id")[metric.score].mean()

    return pd.DataFrame({"nearest": means(baselines.ORACLE)} | {method: means(method) for _, method in MODELS})


def relatives_table(found: Mapping[str, pd.DataFrame]) -> Table | None:
    """Means over test shapes with a near relative among the training shapes, and over the others; None without any."""
    rows: list[Sequence[str]] = []
    for group, own in found.items():
        near = own["nearest"] > NEAR
        for label, part in (("near", own[near]), ("others", own[~near])) if near.any() else ():
            scored = (scores.number(float(part[name].mean()), 2) for name in own)
            rows.append([group if label == "near" else "", label, str(len(part)), *scored])
    caption = f"F(τ) over shapes. Near: the nearest training shape has more than {NEAR}, a variant of the same object."
    header = ["", "relatives", "shapes", "nearest training shape", *(name for name, _ in MODELS)]
    return Table(caption, header, rows, labels=2) if rows else None


def nearest_table(found: Mapping[str, pd.DataFrame]) -> Table:
    """Of every group the correlation by rank and the count above the line, for each model."""
    rows: list[Sequence[str]] = []
    for group, own in found.items():
        ranks, cells = own.corr("spearman", min_periods=3), [group, str(len(own))]
        for _, model in MODELS:
            above = int((own[model] > own["nearest"]).sum())
            cells += [scores.number(float(ranks.loc["nearest", model]), 2), str(above)]
        rows.append(cells)
    header = ["", "shapes", *(f"{label} {name}" for label, _ in MODELS for name in ("correlation", "above"))]
    return Table("Rank correlation of both scores, and how many test shapes lie above the line.", header, rows)
