"""Normals of random shapes of the VAE's prior, rendered ahead for the image GAN."""

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
    out_dir = run.folder("normals")
    fingerprint = provenance.fingerprint(section, [vae / training_loop.MODEL], normal_images)
    parallel.map_shards(
        normal_images.RenderShard(section, vae, out_dir, fingerprint),
        range(section.images),
        shard_size=section.shard_size,
        out_dir=out_dir,
        fingerprint=fingerprint,
        describe=f"normals {run.category}",
    )
