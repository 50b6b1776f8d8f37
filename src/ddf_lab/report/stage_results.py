"""What the stages left behind for the report: tables, logs, failures, seconds."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from ddf.core import storage
from ddf_lab.evaluation import groups, paper_results, seeds
from ddf_lab.run import STAGES, WHOLE, Run, time_path

MODELS = {"train_ddf": "DDF", "train_pcsiren": "PC-SIREN", "train_ddf_image": "DDF+image"}
CLOUDS = {f"{stage.removeprefix('train_')}.safetensors": label for stage, label in MODELS.items()}  # of `pointclouds`


@dataclasses.dataclass(frozen=True)
class Results:
    """Everything that the stages left behind for the report.

    `table` has means over `seeds` trainings, `trainings` the scores per image of each, `logs` by model the loss of each
    by category; all else is of seed 0. settings: all sections with their defaults. stage_seconds: of the last runs of
    each stage, over categories; None where one has no note. seconds: wall time of a test image, by model and part, mean
    over categories.
    strips: by category, as WebP, from `rendered` images each; `example_strips.drawn` adds these.
    """

    name: str
    index: Mapping[str, Any]
    table: pd.DataFrame
    trainings: Sequence[pd.DataFrame]
    shapes: pd.DataFrame
    logs: Mapping[str, Sequence[Mapping[str, pd.DataFrame]]]
    failures: pd.DataFrame
    stage_seconds: Mapping[str, float | None]
    settings: Mapping[str, Any]
    seeds: int = 1
    seconds: Mapping[str, Mapping[str, float]] = dataclasses.field(default_factory=dict)
    strips: Mapping[str, bytes] = dataclasses.field(default_factory=dict)
    rendered: int = 0

    @property
    def per_image(self) -> pd.DataFrame:
        """Scores per image of the first training."""
        return self.trainings[0]

    @property
    def categories(self) -> list[str]:
        """Names in the order of the experiment file."""
        return list(self.index["categories"])

    @property
    def groups(self) -> dict[str, str]:
        """The category of each group of test shapes, in the order of tables."""
        return groups.names(self.index)


def read_results(run: Run) -> Results:
    """Read and verify all artefacts of an experiment but its clouds.

    Raises:
      FileNotFoundError, InputError: a stage has not run, or left a damaged file; it is named.
    """
    index = storage.read_json(run.index)
    categories = list(index["categories"])
    count = seeds.read_count(run)
    measured = seeds.read_table(run, count)
    paper = paper_results.long_table(categories)
    return Results(
        name=run.name,
        index=index,
        table=pd.concat([measured, paper], ignore_index=True) if len(paper) else measured,
        trainings=[_stored(run.folder("evaluate", seed=seed) / "per_image.csv") for seed in range(count)],
        shapes=_stored(run.folder("evaluate") / "shapes.csv"),
        logs={
            label: [
                {name: pd.read_csv(run.folder(model, name, seed) / "log.csv") for name in categories}
                for seed in range(count)
            ]
            for model, label in MODELS.items()
        },
        failures=_read_failures(run, categories),
        stage_seconds={name: _stage_seconds(run, name, categories) for name in STAGES},
        settings=run.sections(),
        seeds=count,
        seconds={label: _test_seconds(run, file, categories) for file, label in CLOUDS.items()},
    )


def _stored(path: Path) -> pd.DataFrame:
    return storage.load_table(path, dtype={"id": str})[0]


def _test_seconds(run: Run, file: str, categories: Sequence[str]) -> dict[str, float]:
    """Wall time of a test image by part, mean over categories; empty where a run of clouds noted none."""
    paths = [run.folder("pointclouds", name) / file for name in categories]
    notes = [storage.load_metadata(path).get("seconds", {}) for path in paths]
    names = [name for name in notes[0] if all(name in note for note in notes)] if notes else []
    return {name: sum(note[name] for note in notes) / len(notes) for name in names}


def _read_failures(run: Run, categories: Sequence[str]) -> pd.DataFrame:
    folders = [run.folder("dataset")]
    folders += [run.folder(name, category) for name in ("meshes", "samples") for category in categories]
    tables = [pd.read_csv(path, dtype=str) for folder in folders if (path := folder / "failures.csv").exists()]
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=["id", "stage", "reason"])


def _stage_seconds(run: Run, name: str, categories: Sequence[str]) -> float | None:
    """What the notes of a stage's last runs say."""
    paths = [time_path(run.name, name, category) for category in ([""] if name in WHOLE else categories)]
    notes = [storage.read_json(path) if path.exists() else {} for path in paths]
    return sum(note["seconds"] for note in notes) if all("seconds" in note for note in notes) else None
