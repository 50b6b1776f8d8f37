"""Train the encoders with the PC-SIREN baseline on one category."""

import dataclasses
import functools

from ddf.core import provenance
from ddf.data.batches import category_data
from ddf.fields import model_files
from ddf.models import reconstruction_models, reconstruction_settings
from ddf.training import reconstruction_steps, training_loop
from ddf_lab.engine import stage
from ddf_lab.run import Run


@stage.main(category=True, seed=True)
def make(run: Run) -> None:
    train = run.reseeded(reconstruction_settings.TrainConfig)
    section = run.section(reconstruction_settings.PCSirenConfig)
    training_loop.prepare(train.loop)

    images, shapes, sources = category_data.read_training(
        run.index, run.folder("samples"), run.category, train.image_size
    )
    digest, memory = images.digest(), category_data.DeviceMemory(model_files.device())
    images, shapes = memory.holds("images", images), memory.holds("clouds", shapes)

    model = reconstruction_models.PCSirenModel(train).to(model_files.device())
    model.fit_cameras(images)
    facts = [train, section, run.category, digest]
    record = provenance.record(facts, train.loop.seed, sources, reconstruction_steps)
    record |= {"kind": "pcsiren", "train": dataclasses.asdict(train), "section": dataclasses.asdict(section)}
    step = functools.partial(reconstruction_steps.pcsiren_step, model, images, shapes, train, section)
    groups, label = model.parameter_groups(), f"pcsiren {run.label}"
    out_dir = run.folder("train_pcsiren", seed=run.seed)
    training_loop.fit(model, groups, step, section.steps, train.loop, out_dir, record, label)
