"""`ddf cast`: exact depth, visibility and normals of a mesh along given rays."""

import argparse
import io
from pathlib import Path
from typing import Any

import numpy as np

from ddf.cli import common
from ddf.core import storage
from ddf.geometry import mesh_io, ray_io, raycast


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the mesh, the rays and the output."""
    parser.add_argument("mesh", metavar="MESH", type=Path, help="mesh file; cast as it is, without closing it")
    common.add_rays(parser, "file")
    parser.add_argument("--out", metavar="HITS.npz", type=Path, required=True, help="gets depth, visible, normals")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Cast the rays and write the hits; depth is in the file's units, inf on a miss."""
    points = ray_io.read(args.rays)
    hits = raycast.cast(mesh_io.load(args.mesh), points)
    buffer = io.BytesIO()
    np.savez(buffer, depth=hits.depth.numpy(), visible=hits.visible.numpy(), normals=hits.normals.numpy())
    storage.write_bytes(args.out, buffer.getvalue())
    return {"rays": len(hits.depth), "hits": int(hits.visible.sum()), "out": args.out.as_posix()}
