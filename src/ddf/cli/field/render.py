"""`ddf render`: one picture of a fitted field, one query per pixel that meets its box, or fewer."""

import argparse
import time
from typing import TYPE_CHECKING, Any

from ddf.cli import arguments, pictures
from ddf.core import checks

if TYPE_CHECKING:
    import numpy as np

    from ddf.shape import shape_field

EXAMPLES = (
    "ddf render chair_field depth.png",
    "ddf render chair_field normals.png --output normals --camera -30,20,1.0",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare field, picture and camera."""
    arguments.add_field(parser)
    arguments.add_out(parser, "out", "OUT.png", "picture to write")
    parser.add_argument(
        "--camera",
        metavar="AZ,EL,R",
        default="35,25,0.9",
        help="azimuth and elevation in degrees, distance from the box's centre with 0.57 for one diagonal of the box; "
        "(default %(default)s)",
    )
    parser.add_argument("--size", metavar="N", type=int, default=256, help="pixels a side (default %(default)s)")
    parser.add_argument("--output", choices=arguments.OUTPUTS, default="depth", help="(default %(default)s)")
    parser.add_argument(
        "--refine",
        metavar="SHARE",
        type=float,
        help="depth alone: interpolate pixels where that misses by no more than this share of the box's longest side, "
        "such as 0.001; parts narrower than four pixels may be missed",
    )
    parser.add_argument(
        "--up", choices=arguments.UP_AXES, default="y", help="axis of the mesh that points up (default %(default)s)"
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Render and write the picture; returns how many rays were evaluated and the time that took."""
    from ddf.core import storage
    from ddf.fields import framed_field
    from ddf.report import field_pictures
    from ddf.shape import shape_field

    camera = parse_camera(args.camera)
    shape = shape_field.load(args.field)
    started = time.monotonic()
    if args.refine is None:
        images, evaluated = framed_field.render(shape, camera, args.size, {"visibility", args.output}, args.up)
    else:
        images, evaluated = _refined(shape, camera, args)
    seconds = time.monotonic() - started
    storage.write_bytes(args.out, pictures.encode(field_pictures.picture(args.output, images), ".png"))
    return {
        "output": args.output,
        "pixels": args.size**2,
        "evaluated": evaluated,
        "saved": args.size**2 - evaluated,
        "seen": int((images["visibility"] >= framed_field.SEEN).sum()),
        "seconds": round(seconds, 4),
        "out": args.out.as_posix(),
    }


def _refined(
    shape: "shape_field.ShapeField", camera: tuple[float, float, float], args: argparse.Namespace
) -> "tuple[dict[str, np.ndarray], int]":
    """Depth from fewer rays, and what is seen by it."""
    import numpy as np

    from ddf.fields import framed_field
    from ddf.geometry import sparse_depth

    if args.output != "depth":
        raise checks.InputError(f"--refine goes with --output depth alone; got {args.output}")
    longest = float((shape.upper - shape.lower).max()) / shape.field_from_mesh.scale
    how = sparse_depth.Refinement(args.refine * longest)
    depth, evaluated = framed_field.render_depth(shape, camera, args.size, how, args.up)
    return {"depth": depth, "visibility": np.isfinite(depth).astype(float)}, evaluated


def parse_camera(text: str) -> tuple[float, float, float]:
    """Azimuth, elevation and radius from `az,el,r`.

    Raises:
      InputError: not three numbers.
    """
    try:
        azimuth, elevation, radius = (float(part) for part in text.split(","))
    except ValueError as error:
        raise checks.InputError(f"--camera must be three numbers az,el,r; got {text!r}") from error
    return azimuth, elevation, radius
