"""Train the shape VAE on one category."""

import dataclasses
import functools
from pathlib import Path

from ddf.core import config, distributed, provenance
from ddf.models.generative import settings, shape_vae
from ddf.training import training_loop
from ddf.training.generative import shape_data, vae_step
from ddf_lab.engine import stage


def run(config_path: Path, category: str) -> None:
    """Read the samples of the shapes that are learned, train, write model and log."""
    section = config.load(config_path, settings.VAEConfig)
    index_path = config.artifact_dir(config_path, "dataset") / "index.json"
    samples_dir = config.artifact_dir(config_path, "samples", category)
    training_loop.prepare(section.loop, section.batch_size)

    learned = shape_data.parts(index_path, samples_dir, category, section.held_out).learned
    shapes, sources = shape_data.read(samples_dir, learned)
    model = shape_vae.ShapeVAE(section)
    model.field_scale.fill_(float(shapes.scales.mean()))
    model.to(training_loop.device())
    fingerprint = provenance.fingerprint([section, category, list(learned)], sources, [vae_step])
    training_loop.fit(
        model,
        model.parameter_groups(),
        functools.partial(vae_step.vae_step, model, shapes),
        section.steps,
        section.loop,
        config.artifact_dir(config_path, "train_vae", category),
        provenance.record(fingerprint, section.loop.seed, sources)
        | {"kind": shape_vae.KIND, "category": category, "vae": dataclasses.asdict(section)},
        f"vae {category}",
    )


if __name__ == "__main__":
    stage.main(distributed.shared(run), __doc__, category=True)
