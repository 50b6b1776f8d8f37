"""The map from raw meshes to training meshes, one shard at a time.

`NNN.zip` (written through `storage`): `<id>.ply` (float32, field frame) per shape, `measures.csv` (see `MEASURES`) and
`field_from_raw.json`, the similarity of each shape from the raw file's frame (v1 for ShapeNet).
"""

import csv
import io
import json
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ddf.core import checks, parallel, seeding, storage
from ddf.data import mesh_config
from ddf.geometry import mesh_io, transforms

LOGGER = logging.getLogger(__name__)
MEASURES = ("id", "faces", "watertight", "wrapped", "off_centre", "diagonal", *mesh_config.LOSSES)
V1_TOLERANCE = 0.01  # of the diagonal: how far a box may be from v1's, which is centred at 0 with diagonal 1


@dataclass(frozen=True)
class RawShape:
    """A shape's raw mesh file; the checksum makes a shard stale when the file changes.

    view: an image (path) and its camera (degrees, benchmark units) that the mesh must agree with; None for no check.
    """

    id: str
    path: str
    checksum: str
    view: tuple[str, float, float, float] | None = None


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
    from ddf.data import shapenet  # takes torch, which what reads packs alone does without

    index = storage.read_json(index_path)
    if category not in index["categories"]:
        raise checks.InputError(f"{index_path}: no category {category!r}; it has {', '.join(index['categories'])}")
    entry = index["categories"][category]
    root, synset, found = Path(index["root"]), entry["synset"], []
    for name in (shape["id"] for shape in entry["shapes"]):
        path, renders = shapenet.model_path(root, synset, name), shapenet.rendering_dir(root, synset, name)
        view = None
        if (renders / shapenet.METADATA).is_file():
            view = (shapenet.image_path(root, synset, name, 0).as_posix(), *shapenet.read_cameras(renders)[0].tolist())
        found.append(RawShape(name, path.as_posix(), storage.checksum(path) if path.is_file() else "", view))
    return found


def chosen(shapes: Sequence[RawShape], config: mesh_config.MeshesConfig, category: str) -> list[RawShape]:
    """Those of a category that are prepared, in the order of the data set: all, or as many as the config says."""
    if config.shapes is None or config.shapes >= len(shapes):
        return list(shapes)
    rows = seeding.generator(config.seed, category, "shapes").permutation(len(shapes))[: config.shapes]
    return [shapes[row] for row in sorted(rows)]


def prepare(
    config: mesh_config.MeshesConfig, category: str, shapes: Sequence[RawShape], shard: parallel.Shard
) -> parallel.ShardResult:
    """Map over raw meshes: writes `NNN.zip`."""
    from ddf.data import mesh_preparation, silhouette_check  # what reads packs alone needs none of their packages

    members, rows, maps, failures = {}, [], {}, []
    for shape in shapes:
        try:
            rng = seeding.generator(config.seed, category, shape.id, "measure")
            raw = mesh_io.load(shape.path)
            if shape.view is not None:
                silhouette_check.require(raw, silhouette_check.View(*shape.view))
            prepared = mesh_preparation.prepare(raw, config, rng)
        except (checks.InputError, OSError) as error:
            failures.append(parallel.Failure(shape.id, "meshes", str(error)))
            continue
        members[f"{shape.id}.ply"] = mesh_io.ply_bytes(prepared.mesh)
        off_centre, diagonal = frame_of(raw)
        if max(off_centre, abs(diagonal - 1)) > V1_TOLERANCE:
            LOGGER.warning(
                "%s: its box is %.3g off the origin with diagonal %.3g; v1's are centred there with diagonal 1, so "
                "predicted cameras and scales of this shape are off",
                *(shape.path, off_centre, diagonal),
            )
        values = {"id": shape.id, "faces": len(prepared.mesh.faces)}
        values |= {"off_centre": round(off_centre, 6), "diagonal": round(diagonal, 6)}
        rows.append({name: values.get(name, getattr(prepared, name, None)) for name in MEASURES})
        maps[shape.id] = prepared.field_from_raw.to_dict()
    members["measures.csv"] = _csv_bytes(rows)
    members["field_from_raw.json"] = json.dumps(maps, indent=1).encode()
    sources = {shape.path: shape.checksum for shape in shapes}
    record = {"fingerprint": shard.fingerprint, "seed": config.seed, "sources": sources, "ids": list(maps)}
    path = shard.file(".zip")
    storage.save_pack(path, members, record)
    return parallel.ShardResult([path], failures)


def frame_of(mesh: mesh_io.Mesh) -> tuple[float, float]:
    """How far the middle of a mesh's box is from the origin, and the box's diagonal."""
    lower, upper = mesh.box()
    return float(np.linalg.norm(lower + upper) / 2), float(np.linalg.norm(upper - lower))


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
