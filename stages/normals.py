"""Normals of random shapes of the VAE's prior, rendered ahead for the image GAN."""

import functools

from ddf.core import parallel, provenance
from ddf.fields import model_files
from ddf.models import generated_images, generative_settings
from ddf_lab.engine import stage
from ddf_lab.run import Run


@stage.main(category=True)
def make(run: Run) -> None:
    """Load the VAE, write normals in shards."""
    section = run.section(generative_settings.GANConfig).normals
    vae = run.folder("train_vae")
    parallel.map_shards(
        functools.partial(generated_images.render_shard, section, vae),
        range(section.images),
        shard_size=parallel.shard_size(section.images, most=1000, shards=20),
        out_dir=run.folder("normals"),
        fingerprint=provenance.fingerprint(section, [vae / model_files.MODEL], generated_images),
        describe=f"normals {run.category}",
    )
