"""`ddf render`: one picture of a fitted field, one query per pixel that meets its box."""

import argparse
import time
from pathlib import Path
from typing import Any

from ddf import checks, shape_field, shape_pictures, storage
from ddf.cli import common


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare field, picture and camera."""
    common.add_field(parser)
    parser.add_argument("out", metavar="OUT.png", type=Path, help="picture to write")
    parser.add_argument(
        "--camera",
        metavar="AZ,EL,R",
        default="35,25,0.9",
        help="azimuth and elevation in degrees, distance from the box's centre with 0.57 for one diagonal of the box; "
        "write --camera=-30,... for a negative azimuth (default %(default)s)",
    )
    parser.add_argument("--size", metavar="N", type=int, default=256, help="pixels a side (default %(default)s)")
    parser.add_argument("--output", choices=shape_field.OUTPUTS, default="depth", help="(default %(default)s)")
    parser.add_argument(
        "--up", choices=shape_field.UP_AXES, default="y", help="axis of the mesh that points up (default %(default)s)"
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Render and write the picture; returns how many rays were evaluated and the time that took."""
    camera = parse_camera(args.camera)
    shape = shape_field.load(args.field)
    started = time.monotonic()
    images, evaluated = shape_field.render(shape, camera, args.size, {"visibility", args.output}, args.up)
    seconds = time.monotonic() - started
    storage.write_bytes(args.out, common.png(shape_pictures.picture(args.output, images)))
    return {
        "output": args.output,
        "pixels": args.size**2,
        "evaluated": evaluated,
        "saved": args.size**2 - evaluated,
        "seen": int((images["visibility"] >= shape_field.SEEN).sum()),
        "seconds": round(seconds, 4),
        "out": args.out.as_posix(),
    }


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
