"""Results: both models in the columns of the paper's table `si3dr`, a verdict from them, the paper's numbers."""

from collections.abc import Mapping

from ddf.metrics import cloud_scores
from ddf_lab.evaluation import baselines, paper_results, scoring
from ddf_lab.report.experiment import scores, seed_notes
from ddf_lab.report.experiment.stage_results import Results
from ddf_lab.report.pages import Block, Section, Table

MODELS = ((scores.METHOD_LABELS[scoring.DDF], scoring.DDF), (scores.METHOD_LABELS[scoring.PC_SIREN], scoring.PC_SIREN))
COLUMNS = ("Pi_g-L", "Pi_g-S", "Pi_corrected-S", "Pi_pred-L", "Pi_pred-S")
_VERDICTS = (("With the true camera", "Pi_g-L"), ("With the predicted camera", "Pi_pred-L"))
_CHAMFER = "chamfer_l2_sq_x1000"
_COMPARED = {_CHAMFER: "D<sub>C</sub>", "f_score_tau_x100": "F<sub>τ</sub>"}
_CAPTION = (
    "Single-image reconstruction, measured here. Means over images. Bold: the better model of a row, where their "
    "paired difference is more than chance gives once in twenty times."
)
_PAPER = "The paper's numbers on ShapeNet: other data and other sizes, not comparable cell by cell."
_QUOTED = "The same, of P2M and 3DR. The paper takes them from Pixel2Mesh; they predict in the frame of the view."
_READING = (
    "D<sub>C</sub>: Chamfer distance × 1000, the sum of both means of squared distances.",
    "F<sub>τ</sub>: F-score × 100 at squared distance ≤ τ = {tau}; F<sub>2τ</sub>: at twice that.",
    "Lengths are in benchmark units, 0.57 × v1.",
    "L and S: {large} and {small} predicted points, against the whole true cloud.",
    "Π<sub>g</sub>: true camera. Π̂: predicted camera and estimated scale.",
    "Π̂<sub>∇</sub>: predicted camera after gradient descent on the mask.",
    "The first sentences of the page compare D<sub>C</sub> and F<sub>τ</sub> with L points.",
    "A difference is called one where, paired by image, it exceeds what Student's t asks of its standard error over "
    "{over}, 95 %: two for many, three for three trainings.",
    "Encoders read images with alpha, so both models see the mask. What descends on it has columns that say so.",
)
_LARGE = ("Pi_g-L", "Pi_pred-L")
_SHARE_LABELS = {"precision_tau_x100": "precision ↑", "recall_tau_x100": "recall ↑"}
_SHARES = (
    "What F<sub>τ</sub> is made of, × 100: predicted points near the truth, true points near the prediction. Bold as "
    "above."
)
_ON_MASK = (
    "DDF with shapes moved until their silhouettes from the predicted camera agree with the test image's alpha. "
    "PC-SIREN is given no such descent here. Bold as above."
)
_NEEDED = (  # what is to be done for a column
    ("Π<sub>g</sub>, Π̂", ("encoders", "cloud")),
    ("Π̂<sub>∇</sub>", ("encoders", "cloud", "camera_correction")),
    ("shape moved to the mask", ("encoders", "shape_correction", "cloud")),
)
_SECONDS = (
    "Wall time of a test image, mean over categories: encoding, descents and clouds of both sizes. Several images at a "
    "time, {threads} thread each."
)


def verdict(results: Results) -> str:
    """Which model is better by the rule of claims, in what, with either camera, in two sentences."""
    return " ".join(_sentence(where, better_model(results, column)) for where, column in _VERDICTS)


def better_model(results: Results, column: str) -> dict[tuple[str, str], str]:
    """By category and metric the better model, empty where no difference is seen (`paired.Difference.seen`)."""
    ours, theirs = ((method, column) for _, method in MODELS)
    names = {1: MODELS[0][0], -1: MODELS[1][0], 0: ""}
    return {
        (category, label): names[results.better(category, ours, theirs, metric)]
        for category in results.groups
        for metric, label in _COMPARED.items()
        if results.difference(category, ours, theirs, metric) is not None
    }


def _sentence(where: str, found: Mapping[tuple[str, str], str]) -> str:
    parts = []
    for model, _ in MODELS:
        won: dict[str, list[str]] = {}
        for (category, label), better in found.items():
            if better == model:
                won.setdefault(category, []).append(label)
        scores_of = [f"{category} ({' and '.join(labels)})" for category, labels in won.items()]
        parts += [f"{model} is better for {_listed(scores_of)}"] if won else []
    if "" in found.values():
        parts.append(f"no {'other ' if parts else ''}difference is seen")
    return f"{where}, {'; '.join(parts)}." if parts else f"{where}, nothing was compared."


def _listed(names: list[str]) -> str:
    return " and ".join(", ".join(names).rsplit(", ", 1))


def section(results: Results) -> Section:
    """Our table, what follows from it, how to read it, the paper's table."""
    caption, shares = (seed_notes.over_seeds(results, text) for text in (_CAPTION, _SHARES))
    blocks: list[Block | None] = [
        scores.pairs(results, results.groups, COLUMNS, MODELS, caption),
        scores.pairs(results, results.groups, _LARGE, MODELS, shares, labels=_SHARE_LABELS),
        on_the_mask(results),
        seconds(results),
        tuple(findings(results)),
        "How to read the tables:",
        reading(results),
        scores.pairs(results, results.categories, COLUMNS, MODELS, _PAPER, paper_results.SOURCE),
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
            for category in results.groups
            if (ours := table.value(category, (method, "Pi_g-L"), _CHAMFER))
            and (mean := table.value(category, (baselines.MEAN_SHAPE, "Pi_g-L"), _CHAMFER))
        ]
        found.append(f"D<sub>C</sub> of the mean shape over that of {label} (true camera, L): {', '.join(ratios)}.")
    found += [_against_retrieval(results, label, method) for label, method in MODELS]
    changes = []
    for category in results.groups:
        before, after = (
            table.value(category, (scoring.DDF, column), _CHAMFER) for column in ("Pi_pred-S", "Pi_corrected-S")
        )
        if before is not None and after is not None:
            changes.append(f"{category} {before:.3f} → {after:.3f}")
    corrected = f"D<sub>C</sub> of DDF (S) as the predicted camera is corrected by the mask: {', '.join(changes)}."
    return [*found, corrected] if changes else found


def _against_retrieval(results: Results, label: str, method: str) -> str:
    """For which categories a model is better than retrieval by the rule of claims, and for which it is not."""
    heads = (method, "Pi_g-L"), (baselines.RETRIEVAL, "Pi_g-L")
    won = [category for category in results.groups if results.better(category, *heads, _CHAMFER) > 0]
    rest = [category for category in results.groups if category not in won]
    parts = ([f"better for {_listed(won)}"] if won else []) + ([f"not for {_listed(rest)}"] if rest else [])
    return f"{label} against retrieval of a training shape (D<sub>C</sub>, true camera, L): {'; '.join(parts)}."


def reading(results: Results) -> tuple[str, ...]:
    """What columns and metrics are."""
    rows = results.per_image[results.per_image["method"] == scoring.PC_SIREN]
    large, small = (int(rows[rows["column"] == f"Pi_g-{size}"]["num_pred"].iloc[0]) for size in "LS")
    values = {
        "tau": f"{cloud_scores.TAU_SQ:g}",
        "large": f"{large:,}",
        "small": f"{small:,}",
        "over": "test shapes and seeds" if results.seeds > 1 else "test shapes",
    }
    return tuple(text.format(**values) for text in _READING)


def on_the_mask(results: Results) -> Table | None:
    """DDF with shapes moved until they agree with the test image's mask, beside the shapes as encoded."""
    methods = (("as encoded", scoring.DDF), ("on the mask", scoring.DDF_ON_MASK))
    if not (results.per_image["method"] == scoring.DDF_ON_MASK).any():
        return None
    caption = seed_notes.over_seeds(results, _ON_MASK)
    return scores.pairs(results, results.groups, _LARGE, methods, caption)


def seconds(results: Results) -> Table | None:
    """Wall time that a test image takes, by what its columns need."""
    rows = []
    for label, parts in _NEEDED:
        for model, _ in MODELS:
            known = results.seconds.get(model, {})
            if all(part in known for part in parts):
                rows.append([label, model, f"{sum(known[part] for part in parts):.2f}"])
    header = ["columns", "", "seconds"]
    caption = seed_notes.of_first(results, _SECONDS.format(threads=results.settings["train"].loop.threads))
    return Table(caption, header, rows, labels=2) if rows else None


def quoted(results: Results) -> Table | None:
    """P2M and 3DR, which were not run."""
    table = scores.Scores(results.table, paper_results.SOURCE)
    heads = [head for head in paper_results.SI3DR_COLUMNS if head[1] == "view frame"]
    rows = [
        [
            category if head == heads[0] else "",
            scores.METHOD_LABELS[head[0]],
            *(table.cell(category, head, metric) for metric in cloud_scores.PRINTED),
        ]
        for category in results.paper_categories
        for head in heads
    ]
    header = ["", "", *(str(metric.label) for metric in cloud_scores.PRINTED.values())]
    return Table(_QUOTED, header, rows, labels=2) if rows else None
