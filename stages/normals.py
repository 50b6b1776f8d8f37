"""Normals of random shapes of the VAE's prior, rendered ahead for the image GAN."""

import functools

from ddf.core import parallel, provenance
from ddf.models.generative import normal_images, settings
from ddf.training import training_loop
from ddf_lab.engine import stage
from ddf_lab.run import Run


@stage.main(category=True)
def make(run: Run) -> None:
    """Load the VAE, write normals in shards."""
    section = run.section(settings.GANConfig).normals
    vae = run.folder("train_vae")
    parallel.map_shards(
        functools.partial(normal_images.render_shard, section, vae),
        range(section.images),
        shard_size=parallel.shard_size(section.images, most=1000, shards=20),
        out_dir=run.folder("normals"),
        fingerprint=provenance.fingerprint(section, [vae / training_loop.MODEL], normal_images),
        describe=f"normals {run.category}",
    )
