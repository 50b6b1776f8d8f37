"""Times and memory of the stages."""

import os

from ddf_lab.report.experiment import scores, seed_notes
from ddf_lab.report.experiment.stage_results import Results
from ddf_lab.report.pages import Section, Table

_CAPTION = "Wall time of each stage's last run, summed over categories, on {threads} CPU threads."
_READING = (
    "Several categories run side by side: the whole takes less than the sum.",
    "Of a stage that was resumed, only the last part is counted.",
    "Memory: the largest resident memory of the stage's process, and of its largest worker process, in any category.",
    "A worker runs on each CPU thread, two at least. Shared pages count in each process.",
)


def section(results: Results) -> Section:
    """One table."""
    return Section("Times and memory", [table(results), _READING])


def table(results: Results) -> Table:
    """A row per stage, and the sum of the times."""
    rows = []
    for name, cost in results.costs.items():
        seconds = "not timed" if cost.seconds is None else duration(cost.seconds)
        memory = [f"{value:,.0f}" if value else scores.NOTHING for value in (cost.peak_mib, cost.worker_peak_mib)]
        rows.append([name, seconds, *memory])
    known = [cost.seconds for cost in results.costs.values() if cost.seconds is not None]
    together = duration(sum(known)) if known else scores.NOTHING
    rows.append(["together", together, "", ""])
    header = ["stage", "time", "memory, MiB", "of a worker, MiB"]
    caption = seed_notes.of_first(results, _CAPTION.format(threads=os.cpu_count()))
    return Table(caption, header, rows)


def duration(seconds: float) -> str:
    """Seconds, minutes or hours, whichever reads best."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.1f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
