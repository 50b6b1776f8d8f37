"""Raw meshes to closed, small meshes in the field frame, with the loss of each."""

import functools

from ddf.core import parallel, provenance
from ddf.data import mesh_preparation, mesh_shards
from ddf_lab.engine import stage
from ddf_lab.run import Run


@stage.main(category=True)
def make(run: Run) -> None:
    """Read the data set's index, prepare every shape of the category, write packs."""
    section = run.section(mesh_preparation.MeshesConfig)
    shapes = mesh_shards.chosen(mesh_shards.raw_shapes(run.index, run.category), section, run.category)
    parallel.map_shards(
        functools.partial(mesh_shards.prepare, section, run.category),
        shapes,
        shard_size=parallel.shard_size(len(shapes)),
        out_dir=run.folder("meshes"),
        fingerprint=provenance.fingerprint(section, [], mesh_shards),
        describe=f"meshes {run.category}",
    )
