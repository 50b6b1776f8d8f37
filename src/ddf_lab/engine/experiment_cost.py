"""What an experiment will cost, stated before it runs: shapes, samples, disk, steps and the time of its trainings."""

import contextlib
import dataclasses
import os
from collections.abc import Iterator
from typing import Any

import torch

from ddf.core import storage
from ddf.data import dataset, sampling
from ddf.fields import model_files, pddf
from ddf.models import loop_config, reconstruction_models, reconstruction_settings
from ddf.training import training_loop
from ddf_lab.engine import step_cost
from ddf_lab.run import Run

SAMPLE_BYTES = 14  # as `packing` stores a sample: 6 position, 4 direction, 2 depth, 2 normal
CLOUD_BYTES = 13  # of a true point: three float32 and whether it is hidden
MODEL_COPIES = 4  # of the parameters on disk: the model, and the checkpoint with AdamW's two moments


def predict(run: Run, measured: bool) -> dict[str, Any]:
    """Shapes, samples and bytes by category, steps, and with `measured` seconds of the trainings on this machine.

    A category of which all shapes are taken is counted once the stage `dataset` has listed them; until then its
    numbers, and the sums, are null and those `per_shape` hold. Meshes and synthetic renders are not in the bytes.
    """
    train, drawn = run.section(reconstruction_settings.TrainConfig), run.section(sampling.SamplesConfig)
    models = {
        "ddf": run.section(reconstruction_settings.DDFConfig),
        "pcsiren": run.section(reconstruction_settings.PCSirenConfig),
    }
    shapes = count_shapes(run)
    samples = sum(drawn.counts.values())
    per_shape = {"samples": samples, "bytes": samples * SAMPLE_BYTES + drawn.cloud_points * CLOUD_BYTES}
    known = [count for count in shapes.values() if count is not None]
    total = sum(known) if len(known) == len(shapes) else None
    in_all = {name: each.steps * len(shapes) for name, each in models.items()}
    trained = len(shapes) * MODEL_COPIES * 4 * _parameters(train, models)
    return {
        "shapes": {**shapes, "all": total},
        "per_shape": per_shape,
        "samples": None if total is None else total * samples,
        "disk_bytes": {
            "samples": None if total is None else total * per_shape["bytes"],
            "trainings": trained,
        },
        "steps": {name: section.steps for name, section in models.items()},
        "trainings": len(shapes) * len(models),
        "steps_in_all": in_all,
        "training_time": _training_time(train, models, in_all) if measured else None,
    }


def count_shapes(run: Run) -> dict[str, int | None]:
    """Shapes by category: those listed by the stage `dataset` where it has run, else as many as the file asks for."""
    categories = run.section(dataset.DatasetConfig).categories
    if not run.index.exists():
        return dict(categories)
    listed = storage.read_json(run.index)["categories"]
    return {name: len(listed[name]["shapes"]) if name in listed else count for name, count in categories.items()}


def _parameters(train: reconstruction_settings.TrainConfig, models: dict[str, Any]) -> int:
    """Of one DDF model and one PC-SIREN model together."""
    with torch.device("meta"):
        built = (
            reconstruction_models.ddf_model(train, models["ddf"].field),
            reconstruction_models.pcsiren_model(train),
        )
    return sum(pddf.count_parameters(model) for model in built)


def _training_time(
    train: reconstruction_settings.TrainConfig, models: dict[str, Any], in_all: dict[str, int]
) -> dict[str, Any]:
    """Seconds per step of each model, measured on random data, and hours of all steps of all categories."""
    threads = min(train.loop.threads, os.cpu_count() or 1)
    found: dict[str, Any] = {"device": model_files.device().type, "threads": threads, "batch_size": train.batch_size}
    hours = 0.0
    with _as_in_training(dataclasses.replace(train.loop, threads=threads)):
        for name, section in models.items():
            cost = step_cost.measure(train, section)
            spent = cost.seconds * in_all[name] / 3600
            found[name] = {"step_seconds": cost.seconds, "measured_images": cost.trial_images, "hours": spent}
            hours += spent
    return found | {"hours": hours}


@contextlib.contextmanager
def _as_in_training(loop: loop_config.LoopConfig) -> Iterator[None]:
    """Threads and operators of a training, put back afterwards."""
    threads, deterministic = torch.get_num_threads(), torch.are_deterministic_algorithms_enabled()
    training_loop.prepare(loop)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
        torch.use_deterministic_algorithms(deterministic)
