"""Train the shape VAE on one category."""

import dataclasses
import functools

from ddf.core import provenance
from ddf.fields import model_files
from ddf.models import generative_models, generative_settings
from ddf.training import generative_steps, shape_data, training_loop
from ddf_lab.engine import stage
from ddf_lab.run import Run


@stage.main(category=True)
def make(run: Run) -> None:
    section = run.section(generative_settings.VAEConfig)
    samples_dir = run.folder("samples")
    training_loop.prepare(section.loop)

    learned = shape_data.parts(run.index, samples_dir, run.category, section.held_out).learned
    shapes, sources = shape_data.read(samples_dir, learned)
    model = generative_models.ShapeVAE(section)
    model.field_scale.fill_(float(shapes.scales.mean()))
    model.to(model_files.device())
    record = provenance.record([section, run.category, list(learned)], section.loop.seed, sources, generative_steps)
    record |= {"kind": generative_models.VAE, "category": run.category, "vae": dataclasses.asdict(section)}
    step, out_dir = functools.partial(generative_steps.vae_step, model, shapes), run.folder("train_vae")
    groups, label = model.parameter_groups(), f"vae {run.category}"
    training_loop.fit(model, groups, step, section.steps, section.loop, out_dir, record, label)
