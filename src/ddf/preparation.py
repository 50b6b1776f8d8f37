"""The two maps over shapes: raw mesh -> training mesh, and training mesh -> samples and clouds, one shard at a time.

Formats (all written through `storage`):
- `NNN.zip`: `<id>.ply` (float32, field frame) per shape, `measures.csv` (see `MEASURES`) and `field_from_raw.json`, the
  similarity of each shape from the raw file's frame.
- `NNN.samples.safetensors`: `<type>.<field>` of shape (shapes, samples, ...) as in `packing`; metadata `ids`,
  `field_from_raw`, `packing_errors`.
- `NNN.clouds.safetensors`: `points` float32 (total, 3) in the raw frame (v1 for ShapeNet), `offsets` int64 (shapes + 1,),
  `hidden` bool (total,); metadata `ids`, `hidden_share`.
"""

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ddf import checks, clouds, mesh_io, meshes, parallel, provenance, sampling, storage, transforms

MEASURES = ("id", "faces", "watertight", "wrapped", "hausdorff", "mean_distance", "hausdorff_hidden")


@dataclass(frozen=True)
class RawShape:
    """A shape's raw mesh file; the checksum makes a shard stale when the file changes."""

    id: str
    path: str
    checksum: str


@dataclass(frozen=True)
class PreparedShape:
    """A shape inside a pack of prepared meshes, and its raw mesh file."""

    id: str
    pack: str
    pack_checksum: str
    raw: RawShape


@dataclass(frozen=True)
class PreparedPack:
    """What a pack of prepared meshes holds."""

    meshes: dict[str, mesh_io.Mesh]
    field_from_raw: dict[str, transforms.Similarity]
    measures: list[dict[str, str]]


def raw_shapes(index_path: Path, category: str) -> list[RawShape]:
    """The category's shapes in the order of the data set.

    Raises:
      InputError: an unknown category, or a shape without its mesh file.
    """
    index = storage.read_json(index_path)
    if category not in index["categories"]:
        raise checks.InputError(f"{index_path}: no category {category!r}; it has {', '.join(index['categories'])}")
    entry = index["categories"][category]
    folder = Path(index["root"]) / "ShapeNetCore.v1" / entry["synset"]
    paths = [(shape["id"], folder / shape["id"] / "model.obj") for shape in entry["shapes"]]
    return [RawShape(name, path.as_posix(), storage.checksum(path) if path.is_file() else "") for name, path in paths]


@dataclass(frozen=True)
class PrepareShard:
    """Map over raw meshes: writes `NNN.zip`."""

    config: meshes.MeshesConfig
    category: str
    out_dir: Path
    fingerprint: str

    def __call__(self, shapes: Sequence[RawShape], index: int) -> parallel.ShardResult:
        members, rows, maps, failures = {}, [], {}, []
        for shape in shapes:
            try:
                rng = sampling.generator(self.config.seed, self.category, shape.id, "measure")
                prepared = meshes.prepare(mesh_io.load(shape.path), self.config, rng)
            except (checks.InputError, OSError) as error:
                failures.append(parallel.Failure(shape.id, "meshes", str(error)))
                continue
            members[f"{shape.id}.ply"] = mesh_io.ply_bytes(prepared.mesh)
            values = {"id": shape.id, "faces": len(prepared.mesh.faces)}
            rows.append({name: values.get(name, getattr(prepared, name, None)) for name in MEASURES})
            maps[shape.id] = prepared.field_from_raw.to_dict()
        members["measures.csv"] = _csv_bytes(rows)
        members["field_from_raw.json"] = json.dumps(maps, indent=1).encode()
        record = provenance.record(self.fingerprint, self.config.seed)
        sources = {shape.path: shape.checksum for shape in shapes}
        path = self.out_dir / f"{index:03d}.zip"
        storage.save_pack(path, members, {**record, "sources": sources, "ids": list(maps)})
        return parallel.ShardResult([path], failures)


def _csv_bytes(rows: list[dict]) -> bytes:
    buffer = io.StringIO()
    writer = csv.DictWriter(buffer, MEASURES, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return buffer.getvalue().encode()


def read_pack(path: Path | str) -> PreparedPack:
    """The prepared meshes of one shard, checksum verified."""
    members, _ = storage.load_pack(path)
    maps = json.loads(members["field_from_raw.json"])
    return PreparedPack(
        meshes={name: mesh_io.parse(members[f"{name}.ply"], ".ply") for name in maps},
        field_from_raw={name: transforms.Similarity.from_dict(values) for name, values in maps.items()},
        measures=list(csv.DictReader(io.StringIO(members["measures.csv"].decode()))),
    )


def prepared_shapes(folder: Path, raw: Sequence[RawShape]) -> list[PreparedShape]:
    """The shapes that the packs of a folder hold, in the order of the data set.

    Raises:
      FileNotFoundError: no packs there: the stage before has not run.
    """
    packs = sorted(folder.glob("*.zip"))
    if not packs:
        raise FileNotFoundError(f"{folder}: no prepared meshes; run stage meshes first")
    by_id = {shape.id: shape for shape in raw}
    shapes = []
    for pack in packs:
        _, metadata = storage.load_pack(pack)
        checksum = storage.checksum(pack)
        shapes += [PreparedShape(name, pack.as_posix(), checksum, by_id[name]) for name in metadata["ids"]]
    return shapes


@dataclass(frozen=True)
class ExtractShard:
    """Map over prepared meshes: writes `NNN.samples.safetensors` and `NNN.clouds.safetensors`."""

    config: sampling.SamplesConfig
    category: str
    out_dir: Path
    fingerprint: str

    def __call__(self, shapes: Sequence[PreparedShape], index: int) -> parallel.ShardResult:
        packs = {pack: read_pack(pack) for pack in dict.fromkeys(shape.pack for shape in shapes)}
        done, failures = [], []
        for shape in shapes:
            try:
                done.append(_Extracted.make(shape, packs[shape.pack], self.config, self.category))
            except (checks.InputError, OSError) as error:
                failures.append(parallel.Failure(shape.id, "samples", str(error)))
        if not done:
            return parallel.ShardResult([], failures)
        record = provenance.record(self.fingerprint, self.config.seed)
        record["sources"] = {shape.pack: shape.pack_checksum for shape in shapes}
        return parallel.ShardResult([*_write_extracted(done, self.out_dir, index, record)], failures)


@dataclass(frozen=True)
class _Extracted:
    id: str
    arrays: dict[str, np.ndarray]
    errors: dict[str, float]
    cloud: clouds.Cloud
    field_from_raw: transforms.Similarity

    @classmethod
    def make(
        cls, shape: PreparedShape, pack: PreparedPack, config: sampling.SamplesConfig, category: str
    ) -> "_Extracted":
        arrays, errors = sampling.extract(pack.meshes[shape.id], config, category, shape.id)
        rng = sampling.generator(config.seed, category, shape.id, "cloud")
        cloud = clouds.draw(mesh_io.load(shape.raw.path), config.cloud_points, rng)
        return cls(shape.id, arrays, errors, cloud, pack.field_from_raw[shape.id])


def _write_extracted(done: list[_Extracted], out_dir: Path, index: int, record: dict) -> list[Path]:
    ids = [item.id for item in done]
    tensors = {name: np.stack([item.arrays[name] for item in done]) for name in done[0].arrays}
    sizes = [len(item.cloud.points) for item in done]
    cloud_tensors = {
        "points": np.concatenate([item.cloud.points for item in done]).astype(np.float32),
        "offsets": np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        "hidden": np.concatenate([item.cloud.hidden for item in done]),
    }
    errors = {name: max(item.errors[name] for item in done) for name in done[0].errors}
    maps = {item.id: item.field_from_raw.to_dict() for item in done}
    paths = [out_dir / f"{index:03d}.samples.safetensors", out_dir / f"{index:03d}.clouds.safetensors"]
    storage.save_tensors(paths[0], tensors, {**record, "ids": ids, "field_from_raw": maps, "packing_errors": errors})
    share = {item.id: float(item.cloud.hidden.mean()) for item in done}
    storage.save_tensors(paths[1], cloud_tensors, {**record, "ids": ids, "hidden_share": share})
    return paths
