"""What does not reproduce: the limits of the experiment, and the settings that are not the paper's."""

import dataclasses

from ddf.core import schema
from ddf_lab.report.experiment.stage_results import Results, printed
from ddf_lab.report.pages import Block, Section, Table

SECTIONS = ("train", "ddf", "pcsiren", "meshes", "samples", "pointclouds")
NOT_GIVEN = "not given"
_PROCEDURAL = "Procedural shapes are made by this project in ShapeNet's layout with the same cameras."
_REAL = "Real shapes are of Debian's archive, few and of few makers, rendered by this project as procedural ones are."
_COMPARE = "Scores compare the methods on these shapes; they do not reproduce the paper's ShapeNet numbers."
_SHAPES = {
    "synthetic": (_PROCEDURAL, _COMPARE),
    "public": (_REAL, _COMPARE),
    "both": (_REAL, _PROCEDURAL, _COMPARE),
    "shapenet": (),
}
_SIZES = ("Sizes differ from the paper's (table below), and so does every number that depends on them.",)
_ONE_SEED = (
    "One seed was trained.",
    "The standard errors in [si3dr.csv](si3dr.csv) are over images and say nothing about other seeds.",
)
_SEEDS = (
    "{seeds} seeds were trained, all on the same data set and samples.",
    "In [si3dr.csv](si3dr.csv) `seeds` says of how many a number is the mean.",
    "Where that is more than one, `spread` is the sample standard deviation over seeds, else the standard error over "
    "images.",
)
_QUOTED = ("P2M and 3D-R2N2 were not run here; their numbers are quoted.",)
_CAPTION = (
    "Settings that differ from the paper's, with its place of each, or that it does not give. `configs/paper.yaml` has "
    "the paper's."
)


def section(results: Results) -> Section:
    """Bullets, and the table of settings where any differs."""
    changed = changed_settings(results)
    limits = [*_SHAPES[results.index["source"]], *(_SIZES if changed else ())]
    limits += [*(_SEEDS if results.seeds > 1 else _ONE_SEED), *_QUOTED]
    blocks: list[Block] = [tuple(text.format(seeds=results.seeds) for text in limits)]
    if changed:
        blocks.append(Table(_CAPTION, ["", "here", "paper"], changed))
    return Section("What does not reproduce", blocks)


def changed_settings(results: Results) -> list[tuple[str, str, str]]:
    """Name, value here and what the paper prints of every setting that is not the paper's, or that it does not give."""
    found, whole = [], "none"
    for name in SECTIONS:
        for each in schema.listed(results.settings[name], name):
            if each.key.startswith(f"{whole}."):
                continue
            if dataclasses.is_dataclass(each.value):
                if each.default is not None:
                    continue  # its settings follow
                whole = each.key  # a part that the paper has not is one line
            if each.value != each.default or not each.source:
                paper = f"{printed(each.default)} ({each.source})" if each.source else NOT_GIVEN
                found.append((f"`{each.key}`: {each.says}", printed(each.value), paper))
    return found
