"""What the page says of an experiment that was trained with several seeds; nothing is added where there is one."""

from ddf_lab.report.experiment.stage_results import Results


def over_seeds(results: Results, text: str) -> str:
    """A text on numbers of the long table, with what they are means over."""
    return _with(results, text, "± is the standard deviation over {seeds} seeds; numbers without it have no training.")


def of_scores(results: Results, text: str) -> str:
    """A text on numbers of the long table that are shown without their spread."""
    return _with(results, text, "Means over {seeds} seeds.")


def of_first(results: Results, text: str) -> str:
    """A text on what is shown of the first seed alone."""
    return _with(results, text, "Of the first of the {seeds} seeds.")


def medians(results: Results, text: str) -> str:
    """A text on times, of which the median is told."""
    return _with(results, text, "Medians over the {seeds} seeds.")


def _with(results: Results, text: str, note: str) -> str:
    return f"{text} {note.format(seeds=results.seeds)}" if results.seeds > 1 else text
