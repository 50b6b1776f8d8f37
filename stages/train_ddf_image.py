"""Train the model with image features along the ray on one category."""

import dataclasses
import functools

from ddf.core import provenance
from ddf.data.batches import category_data
from ddf.fields import model_files
from ddf.models import line_field, out_of_distribution, reconstruction_models, reconstruction_settings
from ddf.training import line_steps, training_loop
from ddf_lab.engine import stage
from ddf_lab.run import Run


@stage.main(category=True, seed=True)
def make(run: Run) -> None:
    how = run.section(line_steps.ImageTrainConfig)
    train, section, start = how.started(run.reseeded(reconstruction_settings.TrainConfig), run.category)
    training_loop.prepare(train.loop)

    images, shapes, sources = category_data.read_training(
        run.index, run.folder("samples"), run.category, train.image_size
    )
    model = line_field.ImageDDFModel(train, section)
    model.fit_box(shapes)
    digest, memory = images.digest(), category_data.DeviceMemory(model_files.device())
    images = memory.holds("images", images)
    samples = memory.holds("samples", category_data.read_samples(run.folder("samples"), shapes.ids))
    model.to(model_files.device()).fit_cameras(images)
    if start is not None:
        line_steps.start_from(model, start)
        sources = [*sources, start]
    record = provenance.record([train, section, run.category, digest], train.loop.seed, sources, line_steps)
    record |= {"kind": line_field.KIND, "train": dataclasses.asdict(train), "section": dataclasses.asdict(section)}
    step = functools.partial(line_steps.ddf_image_step, model, images, shapes, samples, train, section)
    out_dir, loop = run.folder("train_ddf_image", seed=run.seed), section.loop(train.loop)
    label = f"ddf_image {run.label}"
    training_loop.fit(model, model.parameter_groups(), step, section.steps, loop, out_dir, record, label)
    statistics = out_of_distribution.TrainingStatistics.of(reconstruction_models.image_stages(model.eval(), images))
    if statistics is not None:
        statistics.add_to(out_dir)
