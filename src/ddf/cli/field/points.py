"""`ddf points`: a point cloud on the surface of a fitted field."""

import argparse
import time
from typing import Any

from ddf.cli import arguments, cloud_settings

EXAMPLES = ("ddf points chair_field cloud.ply -n 2000",)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare field, cloud and how it is drawn."""
    arguments.add_field(parser)
    arguments.add_out(parser, "out", "OUT.ply", "gets the points, in the mesh's frame")
    parser.add_argument("-n", "--points", metavar="N", type=int, default=5000, help="(default %(default)s)")
    parser.add_argument(
        "--cycles",
        metavar="H",
        type=int,
        default=cloud_settings.CLOUD["cycles"],
        help="projections N_H (default %(default)s)",
    )
    parser.add_argument(
        "--directions",
        metavar="N",
        type=int,
        default=cloud_settings.CLOUD["num_directions"],
        help="tried per point and projection (default %(default)s)",
    )
    parser.add_argument("--seed", metavar="S", type=int, default=0, help="(default %(default)s)")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Draw the points and write them."""
    from ddf.core import storage
    from ddf.geometry import point_io
    from ddf.shape import shape_field

    config = cloud_settings.cloud(num_directions=args.directions, cycles=args.cycles)
    shape = shape_field.load(args.field)
    started = time.monotonic()
    points = shape_field.cloud(shape, args.points, config, args.seed)
    seconds = time.monotonic() - started
    storage.write_bytes(args.out, point_io.points_ply(points))
    return {"points": len(points), "seconds": round(seconds, 4), "out": args.out.as_posix()}
