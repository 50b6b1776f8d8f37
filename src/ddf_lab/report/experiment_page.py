"""The page of an experiment: Markdown with its figures, and the table as CSV.

What is listed comes from the experiment's own index and config, never from what happens to lie in a folder. Nothing
in the files depends on the day; times are those that the stages measured.
"""

from dataclasses import replace
from pathlib import Path

from ddf.core import storage
from ddf_lab.evaluation import claims
from ddf_lab.report import example_strips, model_sections, pages, run_sections, stage_results
from ddf_lab.run import Run

SECTIONS = (  # in the order of the page; each gives a `pages.Section` from the results
    model_sections.results_section,
    run_sections.pictures_section,
    model_sections.baselines_section,
    model_sections.nearest_section,
)
FOLDED = (
    model_sections.one_cycle_section,
    run_sections.cameras_section,
    run_sections.training_section,
    run_sections.data_section,
    run_sections.costs_section,
    run_sections.limits_section,
)
_DATA = {
    "synthetic": "synthetic shapes in ShapeNet's layout",
    "public": "real shapes, those of `ddf shapes`",
    "both": "real shapes, those of `ddf shapes`, and procedural ones, which train together and are tested apart",
    "shapenet": "ShapeNet-v1 with 3D-R2N2 renders",
}


def write(run: Run, out_dir: Path) -> None:
    """Read everything and write README.md, si3dr.csv, per_image.csv and the figures."""
    found = example_strips.drawn(run, stage_results.read_results(run))
    storage.write_text(out_dir / "si3dr.csv", found.table.to_csv(index=False, lineterminator="\n"))
    storage.write_text(out_dir / "per_image.csv", claims.as_text(found.trainings))
    pages.write(build(found), out_dir)


def build(found: stage_results.Results) -> pages.Page:
    """The page from results already read."""
    seeds = f" SEEDS={found.seeds}" if found.seeds > 1 else ""
    facts = [
        f"Experiment `{found.name}`: 3D reconstruction from single images of {_DATA[found.index['source']]}.",
        "DDF: directed distance fields. PC-SIREN: a baseline with the same encoders that maps points of a cube to "
        "surface points. DDF+image: a DDF that asks the image at places along the ray.",
        f"Made by `make reproduce-table CONFIG=configs/{found.name}.yaml{seeds}`. All means are in "
        "[si3dr.csv](si3dr.csv), scores of every image, on which bold rests, in [per_image.csv](per_image.csv).",
    ]
    if seeds:
        facts.append(
            f"Means over {found.seeds} seeds; ± is the standard deviation over them; [si3dr.csv](si3dr.csv) has it of "
            "all. Pictures, losses and times are of the first."
        )
    sections = [section(found) for section in SECTIONS]
    sections += [replace(section(found), folded=True) for section in FOLDED]
    (table, *_) = (block for block in sections[0].blocks if isinstance(block, pages.Table))
    lead = [model_sections.verdict(table), model_sections.effects(found, table), tuple(facts)]
    return pages.Page(f"Results of the experiment {found.name}", lead, sections)
