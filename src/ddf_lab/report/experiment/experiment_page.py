"""The page of an experiment: Markdown with its figures, and the table as CSV.

What is listed comes from the experiment's own index and config, never from what happens to lie in a folder. Nothing
in the files depends on the day; times are those that the stages measured.
"""

from pathlib import Path

from ddf.core import storage
from ddf_lab.report import pages
from ddf_lab.report.experiment import example_strips, seed_notes, stage_results
from ddf_lab.report.experiment.sections import (
    bounds,
    cameras,
    costs,
    data,
    evenness,
    limits,
    nearest,
    one_cycle,
    pictures,
    results,
    training,
)
from ddf_lab.run import Run

SECTIONS = (  # in the order of the page; each gives a `pages.Section` from the results
    results.section,
    pictures.section,
    bounds.section,
    nearest.section,
    one_cycle.section,
    cameras.section,
    evenness.section,
    training.section,
    data.section,
    costs.section,
    limits.section,
)
_FIRST = "examples.webp"
_FIRST_CAPTION = "Of each category the test image whose D<sub>C</sub> of DDF is the median: input, both clouds, truth."
_FIRST_ALT = "a test image of each category with the clouds that DDF and PC-SIREN make of it, and the true cloud"
_DATA = {
    "synthetic": "synthetic shapes in ShapeNet's layout",
    "public": "real shapes, those of `ddf shapes`",
    "both": "real shapes, those of `ddf shapes`, and procedural ones, which train together and are tested apart",
    "shapenet": "ShapeNet-v1 with 3D-R2N2 renders",
}
_LEAD = (
    "Experiment `{name}`: 3D reconstruction from single images of {data}.",
    "DDF: directed distance fields. PC-SIREN: a baseline with the same encoders that maps points of a cube to surface "
    "points.",
    "Made by `make reproduce-table CONFIG=configs/{name}.yaml{seeds}`. All numbers are in [si3dr.csv](si3dr.csv).",
)


def write(run: Run, out_dir: Path) -> None:
    """Read everything and write README.md, si3dr.csv and the figures."""
    found = example_strips.drawn(run, stage_results.read_results(run))
    storage.write_text(out_dir / "si3dr.csv", found.table.to_csv(index=False, lineterminator="\n"))
    pages.write(build(found), out_dir)


def build(found: stage_results.Results) -> pages.Page:
    """The page from results already read."""
    values = {
        "name": found.name,
        "data": _DATA[found.index["source"]],
        "seeds": f" SEEDS={found.seeds}" if found.seeds > 1 else "",
    }
    lead: list[pages.Block] = [results.verdict(found)]
    if found.examples:
        caption = seed_notes.of_first(found, _FIRST_CAPTION)
        lead.append(pages.Figure(_FIRST, caption, _FIRST_ALT, found.examples))
    lead.append(tuple(text.format(**values) for text in _LEAD))
    return pages.Page(f"Results of the experiment {found.name}", lead, [section(found) for section in SECTIONS])
