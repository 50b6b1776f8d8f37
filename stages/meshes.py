"""Raw meshes to closed, small meshes in the field frame, with the loss of each."""

from pathlib import Path

from ddf.core import config, parallel, provenance
from ddf.data import mesh_preparation, mesh_shards
from ddf_lab.engine import stage


def run(config_path: Path, category: str) -> None:
    """Read the data set's index, prepare every shape of the category, write packs."""
    section = config.load(config_path, mesh_preparation.MeshesConfig)
    index_path = config.artifact_dir(config_path, "dataset") / "index.json"
    out_dir = config.artifact_dir(config_path, "meshes", category)
    fingerprint = provenance.fingerprint(section, [], mesh_shards)
    parallel.map_shards(
        mesh_shards.PrepareShard(section, category, out_dir, fingerprint),
        mesh_shards.chosen(mesh_shards.raw_shapes(index_path, category), section, category),
        shard_size=section.shard_size,
        out_dir=out_dir,
        fingerprint=fingerprint,
        describe=f"meshes {category}",
        name_of=lambda shape: shape.id,
    )


if __name__ == "__main__":
    stage.main(run, __doc__, category=True)
