"""Where the models fail: the score of each test shape beside that of the training shape nearest to it."""

import pandas as pd

from ddf.metrics import cloud_scores
from ddf_lab.evaluation import baselines, paired, scoring
from ddf_lab.report import figures
from ddf_lab.report.experiment import scores, seed_notes
from ddf_lab.report.experiment.stage_results import Results
from ddf_lab.report.pages import Figure, Section, Table

_MODELS = (scoring.DDF, scoring.PC_SIREN)
_COLUMN = "Pi_g-L"
_METRIC = cloud_scores.METRICS["f_score_tau_x100"]
_CAPTION = (
    "A dot is a test shape and a model. Across: F(τ) of the training shape nearest to it. Up: F(τ) of the model, mean "
    "over its images. On the line both are the same. Blue: DDF. Orange: PC-SIREN. True camera, L points."
)
_ALT = "scores of both models over the score of the nearest training shape, a dot for each test shape, by category"
_TABLE = "Test shapes of the figure above: rank correlation of both scores, and how many lie above the line."
_READING = (
    "A model that is only right near what it learned rises with the line: correlation near 1, few shapes above it.",
    "Above the line it makes a better shape than any that it was shown.",
)


def section(results: Results) -> Section:
    """A dot for each test shape, then the numbers of every group."""
    found = {group: by_shape(results, group) for group in results.groups}
    dots = figures.score_dots(found, "nearest training shape, F(τ) × 100", "model, F(τ) × 100").encode()
    figure = Figure("nearest.svg", seed_notes.of_scores(results, _CAPTION), _ALT, dots)
    return Section("Far from the training shapes", [figure, table(results, found), _READING])


def by_shape(results: Results, group: str) -> pd.DataFrame:
    """F(τ) × 100 of test shapes, mean over images and trainings: a column `nearest` and one of each model."""
    columns = {"nearest": baselines.ORACLE} | {model: model for model in _MODELS}
    return pd.DataFrame({name: _means(results, group, method) for name, method in columns.items()})


def _means(results: Results, group: str, method: str) -> pd.Series:
    tables = [paired.rows_of(table, group, (method, _COLUMN)) for table in results.trainings]
    return _METRIC.factor * pd.concat(tables).groupby("id")[_METRIC.score].mean()


def table(results: Results, found: dict[str, pd.DataFrame]) -> Table:
    """Of every group the correlation by rank and the count above the line, for each model."""
    rows = []
    for group, own in found.items():
        ranks, cells = own.corr("spearman", min_periods=3), [group, str(len(own))]
        for model in _MODELS:
            above = int((own[model] > own["nearest"]).sum())
            cells += [scores.number(float(ranks.loc["nearest", model]), 2), str(above)]
        rows.append(cells)
    caption = seed_notes.of_scores(results, _TABLE)
    return Table(
        caption,
        [
            "",
            "shapes",
            *(f"{scores.METHOD_LABELS[model]} {name}" for model in _MODELS for name in ("correlation", "above")),
        ],
        rows,
    )
