"""Train the encoders with the PC-SIREN baseline on one category."""

import dataclasses
import functools
from pathlib import Path

from ddf.core import config, distributed, provenance
from ddf.data.batches import category_data, resident
from ddf.models.reconstruction import reconstruction_models, settings
from ddf.training import training_loop
from ddf.training.reconstruction import training_steps
from ddf_lab.engine import stage


def run(config_path: Path, category: str, seed: int = 0) -> None:
    """Read training images and clouds of the category, train, write model and log."""
    train = config.reseeded(config.load(config_path, settings.TrainConfig), seed)
    section = config.load(config_path, settings.PCSirenConfig)
    index_path = config.artifact_dir(config_path, "dataset") / "index.json"
    samples_dir = config.artifact_dir(config_path, "samples", category)
    training_loop.prepare(train.loop, train.batch_size)

    images, shapes, sources = category_data.read_training(index_path, samples_dir, category, train.image_size)
    digest, memory = images.digest(), resident.Memory(training_loop.device())
    images, shapes = memory.images(images), memory.clouds(shapes)

    model = reconstruction_models.pcsiren_model(train).to(training_loop.device())
    model.camera_head.fit(images.cameras)
    modules = [training_steps]
    fingerprint = provenance.fingerprint([train, section, category, digest], sources, modules)
    architecture = {"kind": "pcsiren", "train": dataclasses.asdict(train), "section": dataclasses.asdict(section)}
    training_loop.fit(
        model,
        model.parameter_groups(train.weight_decay_shape, train.weight_decay_camera),
        functools.partial(training_steps.pcsiren_step, model, images, shapes, train, section),
        section.steps,
        train.loop,
        config.artifact_dir(config_path, "train_pcsiren", category, seed),
        provenance.record(fingerprint, train.loop.seed, sources) | architecture,
        f"pcsiren {stage.label(category, seed)}",
    )


if __name__ == "__main__":
    stage.main(distributed.shared(run), __doc__, category=True, seed=True)
