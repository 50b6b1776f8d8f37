"""Train the 2D GAN that the image GAN is compared with: noise to colours, the same critic and images."""

import dataclasses

from ddf.core import provenance
from ddf.fields import model_files
from ddf.models import generative_models, generative_settings
from ddf.training import generative_steps, shape_data, training_loop
from ddf_lab.engine import stage
from ddf_lab.run import Run


@stage.main(category=True)
def make(run: Run) -> None:
    gan = run.section(generative_settings.GANConfig)
    training_loop.prepare(gan.loop)

    images, sources = shape_data.read_pictured(run.index, run.folder("samples"), run.category)
    model = generative_models.NoiseGAN(gan).to(model_files.device())
    record = provenance.record([gan, run.category, images.digest()], gan.loop.seed, sources, generative_steps)
    record |= {"kind": generative_models.GAN_2D, "category": run.category, "gan": dataclasses.asdict(gan)}
    updates, out_dir = generative_steps.noise_updates(model, images), run.folder("train_gan2d")
    groups, label = model.parameter_groups(), f"2D gan {run.category}"
    training_loop.fit(model, groups, updates, gan.steps, gan.loop, out_dir, record, label)
