"""Train the image network whose features the scores are taken on, on images of the VAE's shapes."""

import dataclasses
import functools

from ddf.core import provenance
from ddf.fields import model_files
from ddf.models import generative_settings
from ddf.training import generative_steps, shape_data, training_loop
from ddf_lab.engine import stage
from ddf_lab.run import Run


@stage.main(category=True)
def make(run: Run) -> None:
    section = run.section(generative_settings.ScoresConfig).features
    training_loop.prepare(section.loop)

    images, sources = shape_data.read_sampled(run.index, run.folder("samples"), run.category)
    model = generative_steps.FeatureNetwork(section, len(images.ids)).to(model_files.device())
    record = provenance.record([section, run.category, images.digest()], section.loop.seed, sources, generative_steps)
    record |= {"kind": generative_steps.FEATURES, "category": run.category}
    record |= {"features": dataclasses.asdict(section), "shapes": len(images.ids)}
    step, out_dir = functools.partial(generative_steps.features_step, model, images), run.folder("train_features")
    groups, label = model.parameter_groups(), f"features {run.category}"
    training_loop.fit(model, groups, step, section.steps, section.loop, out_dir, record, label)
