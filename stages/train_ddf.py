"""Train the encoders with the conditional probabilistic DDF on one category."""

import dataclasses
import functools

from ddf.core import provenance
from ddf.data.batches import category_data
from ddf.fields import model_files
from ddf.models import out_of_distribution, reconstruction_models, reconstruction_settings
from ddf.training import proposed_rays, reconstruction_steps, training_loop
from ddf_lab.engine import stage
from ddf_lab.run import Run


@stage.main(category=True, seed=True)
def make(run: Run) -> None:
    train = run.reseeded(reconstruction_settings.TrainConfig)
    section = run.section(reconstruction_settings.DDFConfig)
    training_loop.prepare(train.loop)

    images, shapes, sources = category_data.read_training(
        run.index, run.folder("samples"), run.category, train.image_size
    )
    propose, packs = proposed_rays.Proposer.read(run.folder("meshes"), shapes, section.proposals)
    sources += packs
    digest, memory = images.digest(), category_data.DeviceMemory(model_files.device())
    images = memory.holds("images", images)
    samples = memory.holds("samples", category_data.read_samples(run.folder("samples"), shapes.ids))

    model = reconstruction_models.DDFModel(train, section.field).to(model_files.device())
    model.fit_cameras(images)
    facts, modules = [train, section, run.category, digest], [reconstruction_steps, proposed_rays]
    record = provenance.record(facts, train.loop.seed, sources, modules)
    record |= {"kind": "ddf", "train": dataclasses.asdict(train), "section": dataclasses.asdict(section)}
    given = (model, images, shapes, samples, train, section)
    step = functools.partial(reconstruction_steps.ddf_step, *given, propose=propose)
    groups = model.parameter_groups(section.encoder_share(train.loop))
    out_dir, loop, label = run.folder("train_ddf", seed=run.seed), section.loop(train.loop), f"ddf {run.label}"
    training_loop.fit(model, groups, step, section.steps, loop, out_dir, record, label)
    statistics = out_of_distribution.TrainingStatistics.of(reconstruction_models.image_stages(model.eval(), images))
    if statistics is not None:
        statistics.add_to(out_dir)
