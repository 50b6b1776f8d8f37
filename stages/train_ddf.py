"""Train the encoders with the conditional probabilistic DDF on one category."""

import dataclasses
import functools
from pathlib import Path

from ddf.core import config, distributed, provenance
from ddf.data.batches import category_data, resident
from ddf.models.reconstruction import reconstruction_models, settings, trained
from ddf.training import training_loop
from ddf.training.reconstruction import casting, training_steps, training_truth
from ddf_lab.engine import stage


def run(config_path: Path, category: str, seed: int = 0) -> None:
    """Read training images and samples of the category, train, write model and log."""
    train = config.reseeded(config.load(config_path, settings.TrainConfig), seed)
    section = config.load(config_path, settings.DDFConfig)
    index_path = config.artifact_dir(config_path, "dataset") / "index.json"
    samples_dir = config.artifact_dir(config_path, "samples", category)
    training_loop.prepare(train.loop, train.batch_size)

    images, shapes, sources = category_data.read_training(index_path, samples_dir, category, train.image_size)
    truth = training_truth.read(config_path, category, shapes, section)
    sources += truth.sources
    digest, memory = images.digest(), resident.Memory(training_loop.device())
    images, samples = memory.images(images), memory.samples(truth.samples)
    samples, propose = casting.moved(memory, samples, truth.propose)

    model = reconstruction_models.ddf_model(train, section.field).to(training_loop.device())
    model.camera_head.fit(images.cameras)
    fingerprint = provenance.fingerprint(
        [train, section, category, digest, truth.drawn],
        sources,
        [training_steps, training_truth],
    )
    architecture = {"kind": "ddf", "train": dataclasses.asdict(train), "section": dataclasses.asdict(section)}
    out_dir = config.artifact_dir(config_path, "train_ddf", category, seed)
    training_loop.fit(
        model,
        model.parameter_groups(train.weight_decay_shape, train.weight_decay_camera, section.encoder_share(train.loop)),
        functools.partial(training_steps.ddf_step, model, images, shapes, samples, train, section, propose=propose),
        section.steps,
        section.loop(train.loop),
        out_dir,
        provenance.record(fingerprint, train.loop.seed, sources) | architecture,
        f"ddf {stage.label(category, seed)}",
    )
    if distributed.rank() == 0:
        trained.add_known(model, images, out_dir)


if __name__ == "__main__":
    stage.main(distributed.shared(run), __doc__, category=True, seed=True)
