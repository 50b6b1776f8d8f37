"""Prepared meshes to oriented-point samples, and raw meshes to ground-truth clouds."""

import functools

from ddf.core import parallel, provenance
from ddf.data import mesh_shards, sample_shards
from ddf.data.samples import extraction
from ddf_lab.engine import stage
from ddf_lab.run import Run


@stage.main(category=True)
def make(run: Run) -> None:
    """Read the packs of prepared meshes, write samples and clouds in shards."""
    section = run.section(extraction.SamplesConfig)
    raw = mesh_shards.raw_shapes(run.index, run.category)
    shapes = sample_shards.prepared_shapes(run.folder("meshes"), raw)
    parallel.map_shards(
        functools.partial(sample_shards.extract, section, run.category),
        shapes,
        shard_size=parallel.shard_size(len(shapes)),
        out_dir=run.folder("samples"),
        fingerprint=provenance.fingerprint(section, [], sample_shards),
        describe=f"samples {run.category}",
    )
