"""Normals of random shapes of the VAE's prior, rendered ahead for the image GAN."""

from pathlib import Path

from ddf.core import config, parallel, provenance
from ddf.models.generative import normal_images, settings
from ddf.training import training_loop
from ddf_lab.engine import stage


def run(config_path: Path, category: str) -> None:
    """Load the VAE, write normals in shards."""
    section = config.load(config_path, settings.GANConfig).normals
    vae = config.artifact_dir(config_path, "train_vae", category)
    out_dir = config.artifact_dir(config_path, "normals", category)
    fingerprint = provenance.fingerprint(section, [vae / training_loop.MODEL], normal_images)
    parallel.map_shards(
        normal_images.RenderShard(section, vae, out_dir, fingerprint),
        range(section.images),
        shard_size=section.shard_size,
        out_dir=out_dir,
        fingerprint=fingerprint,
        describe=f"normals {category}",
    )


if __name__ == "__main__":
    stage.main(run, __doc__, category=True)
