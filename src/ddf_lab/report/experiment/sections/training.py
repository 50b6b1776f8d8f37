"""Training: losses, and the wall time that each model got."""

import statistics

from ddf_lab.report import figures
from ddf_lab.report.experiment import seed_notes, stage_results
from ddf_lab.report.experiment.sections.costs import duration
from ddf_lab.report.experiment.stage_results import Results
from ddf_lab.report.pages import Figure, Section, Table

_SAME_PERCENT = 10.0  # wall times no farther apart than this are one budget
_SAME = "Both models trained for the same wall time within {more} %, summed over categories: {spent}."
_OTHER = (
    "The models did not train for the same wall time: summed over categories {spent}, the longer {more} % above the "
    "shorter."
)
_CURVES = "Total loss (thick, smoothed) and its terms without their weights."
_ALT = "falling curves of the total loss and of its terms over the steps, by model and category"
_CAPTION = "Training losses. The models minimise different losses: compare within one model only."


def section(results: Results) -> Section:
    """Loss curves, the budgets, first and last losses."""
    drawn = figures.loss_curves(results.logs).encode()
    picture = Figure("losses.svg", seed_notes.of_first(results, _CURVES), _ALT, drawn)
    return Section("Training", [picture, budget(results), table(results)])


def budget(results: Results) -> str:
    """The wall time that each model trained for, over all categories, and by how much the two differ; of several seeds
    the median.
    """
    seconds = {
        model: statistics.median([stage_results.training_seconds(logs), *results.further_seconds.get(model, [])])
        for model, logs in results.logs.items()
    }
    least, most = min(seconds.values()), max(seconds.values())
    if least <= 0:
        return "The training took no time that was noted."
    more = 100 * (most / least - 1)
    spent = ", ".join(f"{model} {duration(value)}" for model, value in seconds.items())
    told = (_SAME if more <= _SAME_PERCENT else _OTHER).format(spent=spent, more=f"{more:.0f}")
    return seed_notes.medians(results, told)


def table(results: Results) -> Table:
    """Steps, first and last loss and time of every training."""
    rows = []
    for model, logs in results.logs.items():
        for category, log in logs.items():
            last = log.tail(max(1, len(log) // 20))["loss"].mean()
            steps, seconds = int(log["step"].iloc[-1]), float(log["seconds"].iloc[-1])
            rows.append([model, category, f"{steps:,}", f"{log['loss'].iloc[0]:.3f}", f"{last:.3f}", duration(seconds)])
    header = ["", "", "steps", "first loss", "last loss (mean of 5 %)", "time"]
    caption = seed_notes.of_first(results, _CAPTION)
    return Table(caption, header, rows, labels=2)
