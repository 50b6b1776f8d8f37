"""One projection cycle: the paper's table `si3dr1h` beside the same columns with all cycles."""

from ddf_lab.evaluation import paper_results, scoring
from ddf_lab.report.experiment import scores, seed_notes
from ddf_lab.report.experiment.stage_results import Results
from ddf_lab.report.pages import Section

_COLUMNS = tuple(column for _, column in paper_results.SI3DR1H_COLUMNS)
_CAPTION = (
    "DDF with points projected onto the surface once, and {cycles} times (N<sub>H</sub>), each cloud with its own "
    "scale. Bold: the better, by the rule of claims."
)
_PAPER = "The paper's numbers on ShapeNet, tables `si3dr1h` and `si3dr`: other data and other sizes."


def section(results: Results) -> Section:
    """Our table and the paper's."""
    cycles = results.settings["pointclouds"].cloud.cycles
    methods = (("once", scoring.DDF_ONE_CYCLE), (f"{cycles} times", scoring.DDF))
    caption = seed_notes.over_seeds(results, _CAPTION.format(cycles=cycles))
    ours = scores.pairs(results, results.groups, _COLUMNS, methods, caption)
    methods = (("once", scoring.DDF_ONE_CYCLE), ("3 times", scoring.DDF))
    theirs = scores.pairs(results, results.categories, _COLUMNS, methods, _PAPER, paper_results.SOURCE)
    return Section("One projection cycle", [block for block in (ours, theirs) if block])
