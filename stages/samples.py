"""Prepared meshes to oriented-point samples, and raw meshes to ground-truth clouds."""

from ddf.core import parallel, provenance
from ddf.data import mesh_shards, sample_shards, sampling
from ddf_lab.engine import stage
from ddf_lab.run import Run


@stage.main(category=True)
def make(run: Run) -> None:
    """Read the packs of prepared meshes, write samples and clouds in shards."""
    section = run.section(sampling.SamplesConfig)
    out_dir = run.folder("samples")
    raw = mesh_shards.raw_shapes(run.index, run.category)
    shapes = sample_shards.prepared_shapes(run.folder("meshes"), raw)
    fingerprint = provenance.fingerprint(section, [], sample_shards)
    parallel.map_shards(
        sample_shards.ExtractShard(section, run.category, out_dir, fingerprint),
        shapes,
        shard_size=section.shard_size,
        out_dir=out_dir,
        fingerprint=fingerprint,
        describe=f"samples {run.category}",
    )
