"""What a stage is given: the sections of its experiment file, its folders, category and seed."""

import dataclasses
import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, Self, TypeVar, cast

from ddf.core import checks, config
from ddf.core.errors import known_names

# Section of an experiment file: its dataclass, which lives beside the code that uses it. As text, for a stage imports
# only what it reads.
SECTIONS = {
    "dataset": "ddf.data.dataset:DatasetConfig",
    "meshes": "ddf.data.mesh_config:MeshesConfig",
    "samples": "ddf.data.samples.extraction:SamplesConfig",
    "train": "ddf.models.reconstruction_settings:TrainConfig",
    "ddf": "ddf.models.reconstruction_settings:DDFConfig",
    "pcsiren": "ddf.models.reconstruction_settings:PCSirenConfig",
    "ddf_image": "ddf.training.line_steps:ImageTrainConfig",
    "pointclouds": "ddf.models.reconstruction_settings:PointcloudsConfig",
    "evaluate": "ddf_lab.evaluation.scoring:EvaluateConfig",
    "fit": "ddf.fit.fit_settings:FitConfig",
    "vae": "ddf.models.generative_settings:VAEConfig",
    "gan": "ddf.models.generative_settings:GANConfig",
    "scores": "ddf.models.generative_settings:ScoresConfig",
    "figures": "ddf_lab.figures.figure_fields:FiguresConfig",
}
DATA = ("dataset", "meshes", "samples")
Kind = Literal["reconstruction", "generative", "shape", "figures"]
KINDS: dict[Kind, tuple[str, ...]] = {  # of experiments, and their sections
    "reconstruction": (*DATA, "train", "ddf", "pcsiren", "ddf_image", "pointclouds", "evaluate"),
    "generative": (*DATA, "vae", "gan", "scores"),
    "shape": ("fit",),
    "figures": ("figures",),
}
# Of a reconstruction, in the order of the pipeline; without those beside it (export_onnx) and the report itself.
STAGES = ("dataset", "meshes", "samples", "train_ddf", "train_pcsiren", "train_ddf_image", "pointclouds", "evaluate")
WHOLE = ("dataset", "evaluate")  # these run once, all others for each category

T = TypeVar("T")


@dataclasses.dataclass(frozen=True)
class Run:
    """One run of a stage. given: the experiment's sections; of a stage of pipeline.yaml those that `params` lists.

    category: empty where the stage has none. seed: added to the seeds of a section by `reseeded`. Folders are relative
    to the repository, where stages run.
    """

    file: Path
    given: config.Layers
    category: str = ""
    seed: int = 0

    @classmethod
    def read(cls, file: str | Path, category: str = "", seed: int = 0, changes: Sequence[str] = ()) -> Self:
        """That of an experiment file, or of the name of one; its sections are those of its kind, given or not.

        Args:
          changes: as `layer` takes them; they come last.
        Raises:
          InputError: there is no such file, it has an unknown section, or no kind has all of its sections.
        """
        found = config.found_file(file)
        given = config.layers(found)
        for change in changes:
            name, given_there = layer(change)
            given.setdefault(name, []).append((f"--set {change}: {name}", given_there))
        for name, layers in given.items():
            if name not in SECTIONS:
                where = layers[0][0].removesuffix(f": {name}")
                raise checks.InputError(
                    f"{where}: unknown section {name!r}; the sections are {known_names(name, SECTIONS)}"
                )
        kinds: list[Kind] = [kind for kind, names in KINDS.items() if given and given.keys() <= set(names)]
        if not kinds:
            raise checks.InputError(
                f"{found}: no kind of experiment has the sections {', '.join(given) or 'none'} alone"
            )
        return cls(found, {name: given.get(name, []) for name in KINDS[kinds[0]]}, category, seed)

    @property
    def kind(self) -> Kind:
        """By its sections."""
        return next(kind for kind, names in KINDS.items() if names == tuple(self.given))

    @property
    def name(self) -> str:
        """Of the experiment."""
        return self.file.stem

    @property
    def root(self) -> Path:
        """The folder of all that the experiment makes."""
        return Path("artifacts") / self.name

    @property
    def categories(self) -> tuple[str, ...]:
        """Of its data set: none in an experiment of a single shape, or of figures; one in a generative one."""
        if "dataset" not in self.given:
            return ()
        found = tuple(self.section(class_of("dataset")).categories)
        if self.kind == "generative" and len(found) != 1:
            raise checks.InputError(
                f"{self.file}: the models are of one category; dataset.categories has {list(found)}"
            )
        return found

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
        folder = self.root / (f"{stage}_seeds/{seed}" if seed else stage)
        return folder / (self.category if category is None else category)

    def section(self, cls: type[T]) -> T:
        """The section that a dataclass describes; InputError names file and key of what does not fit."""
        place = f"{cls.__module__}:{cls.__qualname__}"
        names = [name for name, own in SECTIONS.items() if own == place]
        if not names:
            raise ValueError(f"run.SECTIONS lists no section of {place}")
        if names[0] not in self.given:
            raise checks.InputError(f"{self.file}: section {names[0]!r} is missing")
        return config.resolve(self.given, names[0], cls)

    def reseeded(self, cls: type[T]) -> T:
        """The same with the run's seed added to every key `seed` in it, however deep."""
        return reseeded(self.section(cls), self.seed)

    def sections(self) -> dict[str, Any]:
        """Every section by name."""
        return {name: self.section(class_of(name)) for name in self.given}


def layer(change: str) -> tuple[str, Any]:
    """The section of `section.key=value`, the key as deep as need be, the value as in YAML; what a file would give."""
    key, equals, text = change.partition("=")
    name, *parts = key.split(".")
    if not equals or not parts:
        raise checks.InputError(f"--set {change}: give section.key=value, such as pcsiren.steps=100")
    value = config.parse_value(text, f"--set {change}")
    for part in reversed(parts):
        value = {part: value}
    return name, value


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
    """Where a stage notes the seconds of its last run, for the report; not an artefact: they differ each time."""
    name = "-".join([stage, *([category] if category else []), *([str(seed)] if seed else [])])
    return Path("artifacts") / experiment / "times" / f"{name}.json"
