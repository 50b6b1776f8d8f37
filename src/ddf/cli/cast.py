"""`ddf cast`: exact depth, visibility and normals of a mesh along given rays."""

import argparse
import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ddf import checks, mesh_io, raycast, rays, storage


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the mesh, the rays and the output."""
    parser.add_argument("mesh", metavar="MESH", type=Path, help="mesh file; cast as it is, without closing it")
    parser.add_argument(
        "--rays",
        metavar="RAYS.npz",
        type=Path,
        required=True,
        help="positions, directions: (N, 3), in the file's frame",
    )
    parser.add_argument("--out", metavar="HITS.npz", type=Path, required=True, help="gets depth, visible, normals")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Cast the rays and write the hits; depth is in the file's units, inf on a miss."""
    points = read_rays(args.rays)
    hits = raycast.cast(mesh_io.load(args.mesh), points)
    buffer = io.BytesIO()
    np.savez(buffer, depth=hits.depth.numpy(), visible=hits.visible.numpy(), normals=hits.normals.numpy())
    storage.write_bytes(args.out, buffer.getvalue())
    return {"rays": len(hits.depth), "hits": int(hits.visible.sum()), "out": args.out.as_posix()}


def read_rays(path: Path) -> rays.OrientedPoints:
    """Positions and directions of an NPZ file, as float64, directions exactly of unit length.

    Raises:
      InputError: not an NPZ file with two (N, 3) arrays of numbers, or directions that are not of unit length.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            if not isinstance(file, np.lib.npyio.NpzFile):
                raise checks.InputError(f"{path}: must be an NPZ file with positions and directions")
            missing = {"positions", "directions"} - set(file.files)
            if missing:
                raise checks.InputError(f"{path}: has no array {sorted(missing)[0]!r}")
            arrays = [np.asarray(file[name]) for name in ("positions", "directions")]
    except checks.InputError:
        raise
    except (ValueError, zipfile.BadZipFile, EOFError, MemoryError) as error:
        raise checks.InputError(f"{path}: not a readable NPZ file ({error or 'too large'})") from error
    for name, array in zip(("positions", "directions"), arrays, strict=True):
        if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "fiu":
            raise checks.InputError(f"{path}: {name} must be numbers of shape (N, 3); got {array.dtype} {array.shape}")
    if len(arrays[0]) != len(arrays[1]):
        raise checks.InputError(f"{path}: {len(arrays[0])} positions but {len(arrays[1])} directions; must be as many")
    positions, directions = (torch.from_numpy(array.astype(np.float64)) for array in arrays)
    try:
        points = rays.OrientedPoints(positions, directions)
    except checks.InputError as error:
        raise checks.InputError(f"{path}: {error}") from error
    return rays.OrientedPoints(positions, points.directions / points.directions.norm(dim=-1, keepdim=True))
