"""The map from raw meshes to training meshes, one shard at a time.

`NNN.meshes.safetensors` (written through `storage`), one shape after the other: `vertices` float32 (total, 3), field
frame; `faces` int32 (total, 3), which count from the first vertex of their shape; `ends` int64 (shapes, 2), where the
vertices and the faces of each end. Metadata: `ids`; `field_from_raw`, the similarity of each shape from the raw file's
frame (v1 for ShapeNet); `measures` of each, see `MEASURES`.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ddf.core import checks, parallel, seeding, storage
from ddf.data import mesh_config
from ddf.geometry import mesh_io, transforms

LOGGER = logging.getLogger(__name__)
SUFFIX = ".meshes.safetensors"
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
    measures: list[dict[str, Any]]


def raw_shapes(index_path: Path, category: str) -> list[RawShape]:
    """The category's shapes in the order of the data set."""
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
    """Map over raw meshes: writes `NNN.meshes.safetensors`."""
    from ddf.data import mesh_preparation  # what reads packs alone needs none of its packages

    meshes, rows, maps, failures = [], [], {}, []
    for shape in shapes:
        try:
            rng = seeding.generator(config.seed, category, shape.id, "measure")
            raw = mesh_io.load(shape.path)
            if shape.view is not None:
                mesh_preparation.require_silhouette(raw, *shape.view)
            prepared = mesh_preparation.prepare(raw, config, rng)
        except (checks.InputError, OSError) as error:
            failures.append(parallel.Failure(shape.id, "meshes", str(error)))
            continue
        meshes.append(prepared.mesh)
        lower, upper = raw.box()
        off_centre, diagonal = float(np.linalg.norm(lower + upper) / 2), float(np.linalg.norm(upper - lower))
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
    tensors = {
        "vertices": np.concatenate([np.zeros((0, 3)), *(mesh.vertices for mesh in meshes)]).astype(np.float32),
        "faces": np.concatenate([np.zeros((0, 3)), *(mesh.faces for mesh in meshes)]).astype(np.int32),
        "ends": np.array([(len(mesh.vertices), len(mesh.faces)) for mesh in meshes], np.int64).reshape(-1, 2).cumsum(0),
    }
    sources = {shape.path: shape.checksum for shape in shapes}
    record = {"fingerprint": shard.fingerprint, "seed": config.seed, "sources": sources}
    told = {"ids": list(maps), "field_from_raw": maps, "measures": rows}
    path = shard.file(SUFFIX)
    storage.save_tensors(path, tensors, record | told)
    return parallel.ShardResult([path], failures)


def read_pack(path: Path | str) -> PreparedPack:
    """The prepared meshes of one shard, checksum verified."""
    tensors, record = storage.load_tensors(path)
    vertices, faces = (
        np.split(tensors[name], ends) for name, ends in zip(("vertices", "faces"), tensors["ends"][:-1].T, strict=True)
    )
    both = zip(record["ids"], vertices, faces, strict=False)  # of no shape they are one empty part
    meshes = {name: mesh_io.Mesh(points.astype(np.float64), own.astype(np.int64)) for name, points, own in both}
    maps = {name: transforms.Similarity.from_dict(values) for name, values in record["field_from_raw"].items()}
    return PreparedPack(meshes, maps, record["measures"])
