"""`ddf cast`: exact depth, visibility and normals of a mesh along given rays."""

import argparse
import io
from pathlib import Path
from typing import Any

from ddf.cli import arguments, results

FAR = 1e-3  # of the diagonal: what float32 rays may be off by before the user is told
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
    from ddf.geometry import exact_cast, mesh_io, raycast, rays

    points = rays.read_npz(args.rays)
    mesh = mesh_io.load(args.mesh)
    hits = exact_cast.cast(mesh, points)
    buffer = io.BytesIO()
    np.savez(buffer, depth=hits.depth, visible=hits.visible, normals=hits.normals)
    storage.write_bytes(args.out, buffer.getvalue())
    rays, seen = len(hits.depth), int(hits.visible.sum())
    verdict = f"{seen:,} of {rays:,} rays hit; depth is in units of {args.mesh}, inf on a miss"
    verdict += results.left_out(mesh.remarks)
    bound = raycast.float32_bound(mesh, points)
    if bound > FAR * mesh.diagonal():
        verdict += f"; starts lie so far away that float32 positions or directions are off by up to {bound:.2g}"
    found = {"rays": rays, "hits": seen, "float32_bound": bound, "left_out": list(mesh.remarks)}
    return {**found, "out": args.out.as_posix(), "verdict": verdict}
