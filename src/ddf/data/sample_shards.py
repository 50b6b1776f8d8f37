"""The map from training meshes to oriented-point samples and ground-truth clouds, one shard at a time.

Written through `storage`:
- `NNN.samples.safetensors`: `<type>.<field>` of shape (shapes, samples, ...) as in `packing`; metadata `ids`,
  `field_from_raw` (similarity by id).
- `NNN.clouds.safetensors`: `points` float32 (total, 3) in the raw frame (v1 for ShapeNet), `offsets` int64 (shapes +
  1,), `hidden` bool (total,); metadata `ids`, `hidden_share`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ddf.core import checks, parallel, seeding, storage
from ddf.data import mesh_shards, true_clouds
from ddf.data.samples import extraction
from ddf.geometry import mesh_io


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
    every, clouds, maps, failures = [], [], {}, []
    for shape in shapes:
        pack = packs[shape.pack]
        try:
            arrays = extraction.extract(pack.meshes[shape.id], config, category, shape.id)
            rng = seeding.generator(config.seed, category, shape.id, "cloud")
            clouds.append(true_clouds.draw(mesh_io.load(shape.raw.path), config.cloud_points, rng))
        except (checks.InputError, OSError) as error:
            failures.append(parallel.Failure(shape.id, "samples", str(error)))
            continue
        every.append(arrays)
        maps[shape.id] = pack.field_from_raw[shape.id].to_dict()
    if not every:
        return parallel.ShardResult([], failures)
    tensors = {name: np.stack([arrays[name] for arrays in every]) for name in every[0]}
    cloud_tensors = {
        "points": np.concatenate([cloud.points for cloud in clouds]).astype(np.float32),
        "offsets": np.cumsum([0, *(len(cloud.points) for cloud in clouds)]).astype(np.int64),
        "hidden": np.concatenate([cloud.hidden for cloud in clouds]),
    }
    sources = {shape.pack: shape.pack_checksum for shape in shapes}
    record = {"fingerprint": shard.fingerprint, "seed": config.seed, "sources": sources, "ids": list(maps)}
    share = {name: float(cloud.hidden.mean()) for name, cloud in zip(maps, clouds, strict=True)}
    paths = [shard.file(".samples.safetensors"), shard.file(".clouds.safetensors")]
    storage.save_tensors(paths[0], tensors, {**record, "field_from_raw": maps})
    storage.save_tensors(paths[1], cloud_tensors, {**record, "hidden_share": share})
    return parallel.ShardResult(paths, failures)
