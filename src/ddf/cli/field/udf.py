"""`ddf udf`: unsigned distances to the surface of a fitted field, and the directions of its closest point."""

import argparse
from pathlib import Path
from typing import Any

from ddf.cli import arguments, image_files

EXAMPLES = ("ddf udf rabbit --points rays.npz --out distances.npz",)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare field, points and output."""
    arguments.add_field(parser)
    parser.add_argument(
        "--points", metavar="P.npz", type=Path, required=True, help="positions: (N, 3), in the mesh's frame"
    )
    arguments.add_out(parser, "--out", "U.npz", "gets distances (N) in mesh units, directions (N, 3)")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """The distance to the nearest hit, of those that the field is surest of, drawn once."""
    import numpy as np

    from ddf.api import field
    from ddf.core import storage
    from ddf.geometry import rays

    (positions,) = rays.npz_vectors(args.points, ("positions",))
    distances, directions = field.load(args.field).udf(positions)
    storage.write_bytes(args.out, image_files.npz({"distances": distances, "directions": directions}))
    least, most = (float(f(distances)) if len(distances) else float("nan") for f in (np.min, np.max))
    return {
        "points": len(distances),
        "method": "cloud",
        "least": least,
        "largest": most,
        "out": args.out.as_posix(),
        "verdict": f"distances of {len(distances):,} points, in mesh units, in {args.out}",
    }
