"""The map from training meshes to oriented-point samples and ground-truth clouds, one shard at a time.

Written through `storage`:
- `NNN.samples.safetensors`: `<type>.<field>` of shape (shapes, samples, ...) as in `packing`; metadata `ids`,
  `field_from_raw` (similarity by id), `packing_errors`.
- `NNN.clouds.safetensors`: `points` float32 (total, 3) in the raw frame (v1 for ShapeNet), `offsets` int64 (shapes +
  1,),
  `hidden` bool (total,); metadata `ids`, `hidden_share`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ddf.core import checks, parallel, seeding, storage
from ddf.data import mesh_shards, packing, true_clouds
from ddf.data.samples import extraction
from ddf.geometry import mesh_io, transforms


@dataclass(frozen=True)
class PreparedShape:
    """A shape inside a pack of prepared meshes, and its raw mesh file."""

    id: str
    pack: str
    pack_checksum: str
    raw: mesh_shards.RawShape


def prepared_shapes(folder: Path, raw: Sequence[mesh_shards.RawShape]) -> list[PreparedShape]:
    """The shapes that the packs of a folder hold, in the order of the data set."""
    packs = sorted(folder.glob(f"*{mesh_shards.SUFFIX}"))
    if not packs:
        raise FileNotFoundError(f"{folder}: no prepared meshes; run stage meshes first")
    by_id = {shape.id: shape for shape in raw}
    shapes = []
    for pack in packs:
        checksum, ids = storage.checksum(pack), storage.load_metadata(pack)["ids"]
        shapes += [PreparedShape(name, pack.as_posix(), checksum, by_id[name]) for name in ids]
    return shapes


def extract(
    config: extraction.SamplesConfig, category: str, shapes: Sequence[PreparedShape], shard: parallel.Shard
) -> parallel.ShardResult:
    """Map over prepared meshes: writes `NNN.samples.safetensors` and `NNN.clouds.safetensors`."""
    packs = {pack: mesh_shards.read_pack(pack) for pack in dict.fromkeys(shape.pack for shape in shapes)}
    done, failures = [], []
    for shape in shapes:
        try:
            done.append(_Extracted.make(shape, packs[shape.pack], config, category))
        except (checks.InputError, OSError) as error:
            failures.append(parallel.Failure(shape.id, "samples", str(error)))
    if not done:
        return parallel.ShardResult([], failures)
    sources = {shape.pack: shape.pack_checksum for shape in shapes}
    record = {"fingerprint": shard.fingerprint, "seed": config.seed, "sources": sources}
    return parallel.ShardResult([*_write_extracted(done, shard, record)], failures)


@dataclass(frozen=True)
class _Extracted:
    id: str
    arrays: dict[str, np.ndarray]
    probes: extraction.Probes
    cloud: packing.Cloud
    field_from_raw: transforms.Similarity

    @classmethod
    def make(
        cls, shape: PreparedShape, pack: mesh_shards.PreparedPack, config: extraction.SamplesConfig, category: str
    ) -> "_Extracted":
        arrays, probes = extraction.extract(pack.meshes[shape.id], config, category, shape.id)
        rng = seeding.generator(config.seed, category, shape.id, "cloud")
        cloud = true_clouds.draw(mesh_io.load(shape.raw.path), config.cloud_points, rng)
        return cls(shape.id, arrays, probes, cloud, pack.field_from_raw[shape.id])


def _write_extracted(done: list[_Extracted], shard: parallel.Shard, record: dict) -> list[Path]:
    ids = [item.id for item in done]
    tensors = {name: np.stack([item.arrays[name] for item in done]) for name in done[0].arrays}
    sizes = [len(item.cloud.points) for item in done]
    cloud_tensors = {
        "points": np.concatenate([item.cloud.points for item in done]).astype(np.float32),
        "offsets": np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        "hidden": np.concatenate([item.cloud.hidden for item in done]),
    }
    errors = extraction.packing_errors([item.probes for item in done])
    maps = {item.id: item.field_from_raw.to_dict() for item in done}
    paths = [shard.file(".samples.safetensors"), shard.file(".clouds.safetensors")]
    storage.save_tensors(paths[0], tensors, {**record, "ids": ids, "field_from_raw": maps, "packing_errors": errors})
    share = {item.id: float(item.cloud.hidden.mean()) for item in done}
    storage.save_tensors(paths[1], cloud_tensors, {**record, "ids": ids, "hidden_share": share})
    return paths
