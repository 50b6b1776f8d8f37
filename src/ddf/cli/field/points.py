"""`ddf points`: a point cloud with normals on the surface of a fitted field."""

import argparse
import time
from typing import Any

from ddf.cli import arguments
from ddf.fields import stored_fields

EXAMPLES = ("ddf points rabbit cloud.ply -n 2000",)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare field, cloud and how it is drawn."""
    arguments.add_field(parser)
    arguments.add_out(parser, "out", "OUT.ply", "gets points and the field's normals there, in the mesh's frame")
    parser.add_argument("-n", "--points", metavar="N", type=int, default=5000, help="(default %(default)s)")
    parser.add_argument(
        "--cycles",
        metavar="H",
        type=int,
        default=stored_fields.CLOUD["cycles"],
        help="projections N_H (default %(default)s)",
    )
    parser.add_argument(
        "--directions",
        metavar="N",
        type=int,
        default=stored_fields.CLOUD["num_directions"],
        help="tried per point and projection (default %(default)s)",
    )
    parser.add_argument("--no-normals", action="store_true", help="write the points alone, in less time")
    parser.add_argument("--seed", metavar="S", type=int, default=0, help="(default %(default)s)")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Draw the points and write them with the normals that the field gives where it is asked beside them."""
    from ddf.core import storage
    from ddf.fields import stored_fields
    from ddf.fit import surfaces
    from ddf.geometry import mesh_io

    shape = stored_fields.load(args.field)
    started = time.monotonic()
    points = stored_fields.points(shape, args.points, args.seed, num_directions=args.directions, cycles=args.cycles)
    normals = None if args.no_normals else surfaces.normals_at(shape, points)
    seconds = time.monotonic() - started
    storage.write_bytes(args.out, mesh_io.points_ply(points, normals))
    unknown = 0 if normals is None else int((normals == 0).all(axis=1).sum())
    words = "without normals" if normals is None else f"with normals of the field {args.field.name}"
    if unknown:
        words += f" (0, 0, 0 at the {unknown:,} that it sees from no side)"
    return {
        "points": len(points),
        "normals": None if normals is None else f"field {args.field}",
        "without_normal": unknown,
        "seconds": round(seconds, 4),
        "out": args.out.as_posix(),
        "table": {"lower corner": points.min(axis=0), "upper corner": points.max(axis=0), "seconds": seconds},
        "verdict": f"{len(points):,} points {words} in {args.out}",
    }
