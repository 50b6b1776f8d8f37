"""Train the image GAN on one category: normals of the VAE's shapes to colours, against images of other shapes."""

import dataclasses
from pathlib import Path

from ddf.core import config, distributed, provenance
from ddf.models.generative import image_gans, normal_images, settings, shape_vae
from ddf.training import training_loop
from ddf.training.generative import gan_steps, shape_data
from ddf_lab.engine import stage


def run(config_path: Path, category: str) -> None:
    """Read images and normals, train, write model and log."""
    gan = config.load(config_path, settings.GANConfig)
    index_path = config.artifact_dir(config_path, "dataset") / "index.json"
    samples_dir = config.artifact_dir(config_path, "samples", category)
    vae_dir = config.artifact_dir(config_path, "train_vae", category)
    training_loop.prepare(gan.loop, gan.batch_size)

    images, sources = shape_data.read_pictured(index_path, samples_dir, category, gan.views)
    normals, shards = normal_images.read(config.artifact_dir(config_path, "normals", category))
    sources += [*shards, vae_dir / training_loop.MODEL]
    vae = shape_vae.load(vae_dir)
    model = image_gans.ImageGAN(vae.config, gan)
    model.decoder.load_state_dict(vae.decoder.state_dict())
    model.field_scale.copy_(vae.field_scale)
    model.to(training_loop.device())
    fingerprint = provenance.fingerprint([gan, category, images.digest()], sources, [gan_steps])
    training_loop.fit(
        model,
        model.parameter_groups(),
        gan_steps.image_updates(model, images, normals),
        gan.steps,
        gan.loop,
        config.artifact_dir(config_path, "train_gan", category),
        provenance.record(fingerprint, gan.loop.seed, sources)
        | gan_steps.record(gan, image_gans.KIND, category)
        | {"vae": dataclasses.asdict(vae.config)},
        f"gan {category}",
    )


if __name__ == "__main__":
    stage.main(distributed.shared(run), __doc__, category=True)
