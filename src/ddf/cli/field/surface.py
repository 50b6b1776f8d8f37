"""`ddf surface`: a triangle mesh of a fitted field, and how near it is to the true one."""

import argparse
import time
from pathlib import Path
from typing import Any

from ddf.cli import arguments

EXAMPLES = ("ddf surface rabbit rabbit.ply", "ddf surface my_field mesh.ply --method udf --truth shape.obj")
METHODS = ("poisson", "closed", "udf")  # as `surfaces.METHODS`
_FINEST = 256


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare field, mesh and way."""
    arguments.add_field(parser)
    arguments.add_out(
        parser,
        "out",
        "OUT",
        "gets the triangles (.ply, .obj, .stl, .off, .glb), in the frame of the mesh that was fitted",
    )
    parser.add_argument(
        "--method",
        choices=METHODS,
        default="poisson",
        help="poisson: smooth, for shapes with an outer side; closed: watertight, hollows full; udf: keeps open and "
        "inner sheets (default poisson)",
    )
    parser.add_argument(
        "--points",
        metavar="N",
        type=arguments.whole_number(100, 20_000),
        default=5000,
        help="that poisson goes through (default 5000)",
    )
    parser.add_argument(
        "--resolution",
        metavar="N",
        type=arguments.whole_number(8, _FINEST),
        default=64,
        help="cells of closed and udf along the longest side (default 64)",
    )
    parser.add_argument("--truth", metavar="MESH", type=Path, help="the true mesh, in the same frame: scores are told")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Extract and write the mesh; scores are in units whose longest side of the true mesh is 2."""
    import numpy as np

    from ddf.api import field
    from ddf.data import mesh_topology
    from ddf.geometry import mesh_io

    mesh_io.require_suffix(args.out.suffix)
    truth = None if args.truth is None else mesh_io.load(args.truth)
    shape = field.load(args.field)
    started = time.monotonic()
    mesh = shape.surface(args.points, args.method, args.resolution)
    seconds = time.monotonic() - started
    mesh.save(args.out)
    result: dict[str, Any] = {
        "method": args.method,
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "watertight": bool(mesh_topology.is_watertight(mesh)),
        "seconds": round(seconds, 3),
        "out": args.out.as_posix(),
    }
    verdict = f"{len(mesh.faces):,} triangles in {args.out}"
    if truth is not None:
        from ddf.metrics import cloud_scores

        used = truth.surface_vertices()
        unit = 2 / float(np.ptp(used, axis=0).max())
        same = [mesh_io.Mesh(unit * each.vertices, each.faces) for each in (mesh, truth)]
        scores = cloud_scores.compare_meshes(same[0], same[1])
        result |= {
            "chamfer_l1": scores.chamfer_l1,
            "chamfer_l2_sq": scores.clouds.chamfer_l2_sq,
            "normal_consistency": scores.normal_consistency,
        }
        verdict += f"; {scores.chamfer_l1:.4f} from the truth on average, whose longest side is 2"
    return result | {"verdict": verdict}
