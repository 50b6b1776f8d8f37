"""What the stages left behind for the report: tables, logs, losses of preparation, failures, time and memory."""

import dataclasses
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from ddf.core import config, storage
from ddf.metrics import cloud_scores
from ddf_lab.evaluation import groups, paired, paper_results, seed_means
from ddf_lab.run import STAGES, WHOLE, Run, time_path

MODELS = {"train_ddf": "DDF", "train_pcsiren": "PC-SIREN"}
CLOUDS = {"ddf.safetensors": "DDF", "pcsiren.safetensors": "PC-SIREN"}  # files of the stage `pointclouds`

Head = tuple[str, str]  # method, column


@dataclasses.dataclass(frozen=True)
class Cost:
    """Of a stage's last runs: wall time, and peak memory of the stage's process and of its largest worker process.

    seconds: summed over categories. peak_mib, worker_peak_mib: largest of the categories. None: a part of it has no
    note; no worker is None too.
    """

    seconds: float | None
    peak_mib: float | None
    worker_peak_mib: float | None


@dataclasses.dataclass(frozen=True)
class Results:
    """Everything that the stages left behind for the report.

    `table` has means over `seeds` trainings, `trainings` the scores per image of each; all else is of seed 0. settings:
    all sections with their defaults. seconds: wall time of a test image, by model and part, mean over categories.
    further_seconds: of each model, what a training of all categories took with each of the further seeds. strips: by
    category, as WebP, from `rendered` images each; examples: the first picture of the page, as WebP;
    `example_strips.drawn` adds these.
    """

    name: str
    index: Mapping[str, Any]
    table: pd.DataFrame
    trainings: Sequence[pd.DataFrame]
    cameras: pd.DataFrame
    shapes: pd.DataFrame
    logs: Mapping[str, Mapping[str, pd.DataFrame]]
    measures: Mapping[str, pd.DataFrame]
    packing_errors: Mapping[str, Mapping[str, float]]
    failures: pd.DataFrame
    costs: Mapping[str, Cost]
    settings: Mapping[str, Any]
    seeds: int = 1
    seconds: Mapping[str, Mapping[str, float]] = dataclasses.field(default_factory=dict)
    further_seconds: Mapping[str, Sequence[float]] = dataclasses.field(default_factory=dict)
    strips: Mapping[str, bytes] = dataclasses.field(default_factory=dict)
    rendered: int = 0
    examples: bytes = b""

    @property
    def per_image(self) -> pd.DataFrame:
        """Scores per image of the first training."""
        return self.trainings[0]

    def difference(self, category: str, first: Head, second: Head, metric: str) -> paired.Difference | None:
        """How the scores of one method and column differ from those of another, see `paired.difference`."""
        return paired.difference(self.trainings, category, first, second, cloud_scores.METRICS[metric])

    def better(self, category: str, first: Head, second: Head, metric: str) -> int:
        """1 where the first is better by more than two standard errors, -1 where the second is, else 0."""
        return paired.better(self.difference(category, first, second, metric), cloud_scores.METRICS[metric])

    @property
    def categories(self) -> list[str]:
        """Names in the order of the experiment file."""
        return list(self.index["categories"])

    @property
    def groups(self) -> dict[str, str]:
        """The category of each group of test shapes, in the order of tables."""
        return groups.names(self.index)

    @property
    def paper_categories(self) -> list[str]:
        """Those for which the paper prints numbers."""
        return [name for name in self.categories if name in paper_results.SI3DR]

    def largest_packing_errors(self) -> dict[str, float]:
        """The largest rounding error of each stored quantity over all categories."""
        names = dict.fromkeys(name for errors in self.packing_errors.values() for name in errors)
        return {name: max(errors.get(name, 0.0) for errors in self.packing_errors.values()) for name in names}


def printed(value: Any) -> str:
    """A setting as a table has it."""
    if value is None:
        return "none"
    if dataclasses.is_dataclass(value) or isinstance(value, Mapping):
        items = value.items() if isinstance(value, Mapping) else config.plain(value).items()
        return ", ".join(f"{name} {own}" for name, own in items)
    if isinstance(value, list | tuple):
        return ", ".join(map(str, value)) or "none"
    return str(value)


def read_results(run: Run) -> Results:
    """Read and verify all artefacts of an experiment but its clouds.

    Raises:
      FileNotFoundError, InputError: a stage has not run, or left a damaged file; it is named.
    """
    folder = run.folder("evaluate")
    index = storage.read_json(run.index)
    categories = list(index["categories"])
    seeds = seed_means.read_count(run)
    measured = seed_means.read_table(run, seeds)
    paper = paper_results.long_table(categories)
    return Results(
        name=run.name,
        index=index,
        table=pd.concat([measured, paper], ignore_index=True) if len(paper) else measured,
        trainings=[_read_scores(run.folder("evaluate", seed=seed)) for seed in range(seeds)],
        cameras=storage.load_table(folder / "cameras.csv", dtype={"id": str})[0],
        shapes=storage.load_table(folder / "shapes.csv", dtype={"id": str})[0],
        logs={label: _read_logs(run, model, categories) for model, label in MODELS.items()},
        measures={name: _read_measures(run.folder("meshes", name)) for name in categories},
        packing_errors={name: _packing_errors(run.folder("samples", name)) for name in categories},
        failures=_read_failures(run, categories),
        costs={name: _stage_cost(run, name, categories) for name in STAGES},
        settings=run.sections(),
        seeds=seeds,
        seconds={label: _test_seconds(run, file, categories) for file, label in CLOUDS.items()},
        further_seconds={
            label: [training_seconds(_read_logs(run, model, categories, seed)) for seed in range(1, seeds)]
            for model, label in MODELS.items()
        },
    )


def _read_scores(folder: Path) -> pd.DataFrame:
    return storage.load_table(folder / "per_image.csv", dtype={"id": str})[0]


def _test_seconds(run: Run, file: str, categories: Sequence[str]) -> dict[str, float]:
    """Wall time of a test image by part, mean over categories; empty where a run of clouds noted none."""
    paths = [run.folder("pointclouds", name) / file for name in categories]
    notes = [storage.load_metadata(path).get("seconds", {}) for path in paths]
    names = [name for name in notes[0] if all(name in note for note in notes)] if notes else []
    return {name: sum(note[name] for note in notes) / len(notes) for name in names}


def training_seconds(logs: Mapping[str, pd.DataFrame]) -> float:
    """What the trainings of all categories took together."""
    return sum(float(log["seconds"].iloc[-1]) for log in logs.values())


def _read_logs(run: Run, model: str, categories: Sequence[str], seed: int = 0) -> dict[str, pd.DataFrame]:
    return {name: _read_log(run.folder(model, name, seed)) for name in categories}


def _read_log(folder: Path) -> pd.DataFrame:
    path = folder / "log.csv"
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist; run the training stage")
    return pd.read_csv(path)


def _read_measures(folder: Path) -> pd.DataFrame:
    packs = (storage.load_pack(path)[0]["measures.csv"] for path in storage.shard_files(folder, ".zip", "meshes"))
    return pd.concat([pd.read_csv(io.BytesIO(text), dtype={"id": str}) for text in packs], ignore_index=True)


def _packing_errors(folder: Path) -> dict[str, float]:
    """The largest error of each kind over all shards."""
    largest: dict[str, float] = {}
    for path in storage.shard_files(folder, ".samples.safetensors", "samples"):
        for name, value in storage.load_metadata(path)["packing_errors"].items():
            largest[name] = max(largest.get(name, 0.0), value)
    return largest


def _read_failures(run: Run, categories: Sequence[str]) -> pd.DataFrame:
    folders = [run.folder("dataset")]
    for name in ("meshes", "samples"):
        folders += [run.folder(name, category) for category in categories]
    tables = [pd.read_csv(path, dtype=str) for folder in folders if (path := folder / "failures.csv").exists()]
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=["id", "stage", "reason"])


def _stage_cost(run: Run, name: str, categories: Sequence[str]) -> Cost:
    """What the notes of a stage's last runs say; notes of earlier versions have no memory."""
    names = [""] if name in WHOLE else list(categories)
    paths = [time_path(run.name, name, category) for category in names]
    notes = [storage.read_json(path) if path.exists() else {} for path in paths]
    known = ([note[key] for note in notes if key in note] for key in ("seconds", "peak_mib", "worker_peak_mib"))
    seconds, own, workers = (values if len(values) == len(notes) else [] for values in known)
    return Cost(
        sum(seconds, 0.0) if seconds else None,
        max(own, default=None),
        max(workers, default=None) or None,
    )
