"""Train the 2D GAN that the image GAN is compared with: noise to colours, the same critic and images."""

from pathlib import Path

from ddf.core import config, distributed, provenance
from ddf.models.generative import image_gans, settings
from ddf.training import training_loop
from ddf.training.generative import gan_steps, shape_data
from ddf_lab.engine import stage


def run(config_path: Path, category: str) -> None:
    """Read images, train, write model and log."""
    gan = config.load(config_path, settings.GANConfig)
    index_path = config.artifact_dir(config_path, "dataset") / "index.json"
    samples_dir = config.artifact_dir(config_path, "samples", category)
    training_loop.prepare(gan.loop, gan.batch_size)

    images, sources = shape_data.read_pictured(index_path, samples_dir, category, gan.views)
    model = image_gans.NoiseGAN(gan).to(training_loop.device())
    fingerprint = provenance.fingerprint([gan, category, images.digest()], sources, [gan_steps])
    training_loop.fit(
        model,
        model.parameter_groups(),
        gan_steps.noise_updates(model, images),
        gan.steps_2d,
        gan.loop,
        config.artifact_dir(config_path, "train_gan2d", category),
        provenance.record(fingerprint, gan.loop.seed, sources) | gan_steps.record(gan, image_gans.KIND_2D, category),
        f"2D gan {category}",
    )


if __name__ == "__main__":
    stage.main(distributed.shared(run), __doc__, category=True)
