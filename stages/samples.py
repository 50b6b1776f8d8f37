"""Prepared meshes to oriented-point samples, and raw meshes to ground-truth clouds."""

from pathlib import Path

from ddf.core import config, parallel, provenance
from ddf.data import mesh_shards, sample_shards, sampling
from ddf_lab.engine import stage


def run(config_path: Path, category: str) -> None:
    """Read the packs of prepared meshes, write samples and clouds in shards."""
    section = config.load(config_path, sampling.SamplesConfig)
    index_path = config.artifact_dir(config_path, "dataset") / "index.json"
    out_dir = config.artifact_dir(config_path, "samples", category)
    raw = mesh_shards.raw_shapes(index_path, category)
    shapes = sample_shards.prepared_shapes(config.artifact_dir(config_path, "meshes", category), raw)
    fingerprint = provenance.fingerprint(section, [], sample_shards)
    parallel.map_shards(
        sample_shards.ExtractShard(section, category, out_dir, fingerprint),
        shapes,
        shard_size=section.shard_size,
        out_dir=out_dir,
        fingerprint=fingerprint,
        describe=f"samples {category}",
        name_of=lambda shape: shape.id,
    )


if __name__ == "__main__":
    stage.main(run, __doc__, category=True)
