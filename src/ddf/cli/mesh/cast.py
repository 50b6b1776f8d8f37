"""`ddf cast`: exact depth, visibility and normals of a mesh along given rays."""

import argparse
import io
from pathlib import Path
from typing import Any

from ddf.cli import arguments

EXAMPLES = ("ddf cast shape.obj --rays rays.npz --out hits.npz",)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the mesh, the rays and the output."""
    parser.add_argument("mesh", metavar="MESH", type=Path, help="mesh file; cast as it is, without closing it")
    arguments.add_rays(parser, "file")
    arguments.add_out(parser, "--out", "HITS.npz", "gets depth, visible, normals")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Cast the rays and write the hits; depth is in the file's units, inf on a miss."""
    import numpy as np

    from ddf.core import storage
    from ddf.geometry import mesh_io, ray_io, raycast

    points = ray_io.read(args.rays)
    hits = raycast.cast(mesh_io.load(args.mesh), points)
    buffer = io.BytesIO()
    np.savez(buffer, depth=hits.depth, visible=hits.visible, normals=hits.normals)
    storage.write_bytes(args.out, buffer.getvalue())
    rays, seen = len(hits.depth), int(hits.visible.sum())
    verdict = f"{seen:,} of {rays:,} rays hit; depth is in units of {args.mesh}, inf on a miss"
    return {"rays": rays, "hits": seen, "out": args.out.as_posix(), "verdict": verdict}
