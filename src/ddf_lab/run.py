"""What a stage is given: the sections of its experiment file, its folders, category and seed."""

import dataclasses
import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self, TypeVar, cast

from ddf.core import checks, config, names

# Section of an experiment file: its dataclass, which lives beside the code that uses it. As text, for a stage imports
# only what it reads.
SECTIONS = {
    "dataset": "ddf.data.dataset:DatasetConfig",
    "meshes": "ddf.data.mesh_config:MeshesConfig",
    "samples": "ddf.data.sampling:SamplesConfig",
    "train": "ddf.models.reconstruction.settings:TrainConfig",
    "ddf": "ddf.models.reconstruction.settings:DDFConfig",
    "pcsiren": "ddf.models.reconstruction.settings:PCSirenConfig",
    "pointclouds": "ddf.models.reconstruction.settings:PointcloudsConfig",
    "evaluate": "ddf_lab.evaluation.scoring:EvaluateConfig",
    "report": "ddf_lab.report.experiment.experiment_page:ReportConfig",
    "export": "ddf.io.onnx_file:ExportConfig",
    "fit": "ddf.fit.fit_settings:FitConfig",
    "vae": "ddf.models.generative.settings:VAEConfig",
    "gan": "ddf.models.generative.settings:GANConfig",
    "scores": "ddf.models.generative.settings:ScoresConfig",
    "figures": "ddf_lab.figures.figure_fields:FiguresConfig",
}
# Of a reconstruction, in the order of the pipeline; without those beside it (export_onnx) and the report itself.
STAGES = ("dataset", "meshes", "samples", "train_ddf", "train_pcsiren", "pointclouds", "evaluate")
WHOLE = ("dataset", "evaluate")  # these run once, all others for each category

T = TypeVar("T")


@dataclasses.dataclass(frozen=True)
class Run:
    """One run of a stage. given: sections as written; of a stage of pipeline.yaml only those that `params` lists.

    category: empty where the stage has none. seed: added to the seeds of a section by `reseeded`. Folders are relative
    to the repository, where stages run.
    """

    file: Path
    given: Mapping[str, Any]
    category: str = ""
    seed: int = 0

    @classmethod
    def read(cls, file: str | Path, category: str = "", seed: int = 0) -> Self:
        """That of an experiment file; InputError: it is none, or has a section that `SECTIONS` does not list."""
        given = config.read(file)
        for name in given:
            if name not in SECTIONS:
                raise checks.InputError(
                    f"{file}: unknown section {name!r}; the sections are {names.known(name, SECTIONS)}"
                )
        return cls(Path(file), given, category, seed)

    @property
    def name(self) -> str:
        """Of the experiment."""
        return self.file.stem

    @property
    def label(self) -> str:
        """What a progress bar calls it: `chair`, and `chair seed 1` for a further seed."""
        return " ".join([*([self.category] if self.category else []), *([f"seed {self.seed}"] if self.seed else [])])

    @property
    def index(self) -> Path:
        """The list of shapes that the stage `dataset` writes."""
        return self.folder("dataset", "") / "index.json"

    @property
    def page(self) -> Path:
        """The folder of the report."""
        return self.folder("report", "")

    def folder(self, stage: str, category: str | None = None, seed: int = 0) -> Path:
        """artifacts/<experiment>/<stage>[/<category>], by default of the own category; of a further seed another."""
        folder = Path("artifacts") / self.name / (f"{stage}_seeds/{seed}" if seed else stage)
        return folder / (self.category if category is None else category)

    def section(self, cls: type[T]) -> T:
        """The section that a dataclass describes; InputError names file and key of what does not fit."""
        place = f"{cls.__module__}:{cls.__qualname__}"
        names = [name for name, own in SECTIONS.items() if own == place]
        if not names:
            raise ValueError(f"run.SECTIONS lists no section of {place}")
        if names[0] not in self.given:
            raise checks.InputError(f"{self.file}: section {names[0]!r} is missing")
        return config.parse(self.given[names[0]], cls, f"{self.file}: {names[0]}")

    def reseeded(self, cls: type[T]) -> T:
        """The same with the run's seed added to every key `seed` in it, however deep."""
        return reseeded(self.section(cls), self.seed)

    def sections(self) -> dict[str, Any]:
        """Every section by name, in the order of the file."""
        return {name: self.section(class_of(name)) for name in self.given}


def class_of(section: str) -> type:
    """The dataclass of a section, imported."""
    module, _, name = SECTIONS[section].partition(":")
    return getattr(importlib.import_module(module), name)


def reseeded(section: T, seed: int) -> T:
    """A section (a dataclass) with `seed` added to every key `seed` in it, however deep."""
    changes: dict[str, Any] = {}
    for field in dataclasses.fields(cast(Any, section)):
        value = getattr(section, field.name)
        if field.name == "seed":
            changes["seed"] = value + seed
        elif dataclasses.is_dataclass(value):
            changes[field.name] = reseeded(value, seed)
    return dataclasses.replace(cast(Any, section), **changes)


def time_path(experiment: str, stage: str, category: str = "", seed: int = 0) -> Path:
    """Where a stage notes time and memory of its last run, for the report; not an artefact: they differ each time."""
    name = "-".join([stage, *([category] if category else []), *([str(seed)] if seed else [])])
    return Path("artifacts") / experiment / "times" / f"{name}.json"
