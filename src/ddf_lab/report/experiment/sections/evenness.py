"""Evenness of the clouds: how far their points keep from each other."""

from ddf_lab.evaluation import baselines, scoring
from ddf_lab.report.experiment import scores, seed_notes
from ddf_lab.report.experiment.stage_results import Results
from ddf_lab.report.pages import Section, Table

_METRIC = "spacing_variation"
_CLOUDS = (
    (scoring.TRUTH, "true cloud"),
    ((baselines.CEILING, "Pi_g-L"), "as many of its points at random"),
    ((scoring.DDF, "Pi_g-L"), scores.METHOD_LABELS[scoring.DDF]),
    ((scoring.DDF_ONE_CYCLE, "Pi_g-L"), scores.METHOD_LABELS[scoring.DDF_ONE_CYCLE]),
    ((scoring.PC_SIREN, "Pi_g-L"), scores.METHOD_LABELS[scoring.PC_SIREN]),
)
_CAPTION = (
    "Variation: standard deviation over mean of the distance from a point to the nearest other one. L points, mean "
    "over images."
)
_READING = (
    "The true clouds are Poisson-disk samples: their points keep a distance.",
    "Independent points spread evenly over a surface have 0.52 (Rayleigh's distribution). More says that points crowd.",
)


def section(results: Results) -> Section:
    """One table."""
    return Section("Evenness of the clouds", [table(results), _READING])


def table(results: Results) -> Table:
    """Variation of the spacing between points, per category and cloud, and its ratio to that of the true cloud."""
    found = scores.Scores(results.table)
    rows = []
    for category in results.groups:
        truth = found.value(category, scoring.TRUTH, _METRIC)
        for head, label in _CLOUDS:
            value = found.value(category, head, _METRIC)
            ratio = scores.number(value / truth, 2) if value is not None and truth else scores.NOTHING
            first = category if head == scoring.TRUTH else ""
            rows.append([first, label, found.text(category, head, _METRIC, 2), ratio])
    header = ["", "", "variation", "of the truth's"]
    caption = seed_notes.over_seeds(results, _CAPTION)
    return Table(caption, header, rows, labels=2)
