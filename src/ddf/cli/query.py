"""`ddf query`: what a fitted field says along given rays, in the frame of the mesh that was fitted."""

import argparse
import io
from pathlib import Path
from typing import Any

import numpy as np

from ddf.cli import common
from ddf.core import checks, storage
from ddf.geometry import ray_io
from ddf.shape import shape_field


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare field, rays and outputs."""
    common.add_field(parser)
    common.add_rays(parser, "mesh")
    parser.add_argument("--out", metavar="OUT.npz", type=Path, required=True, help="gets one array per output")
    parser.add_argument(
        "--outputs",
        metavar="NAMES",
        default="visibility,depth,normals",
        help=f"some of {','.join(shape_field.OUTPUTS)} (default %(default)s)",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Query the field and write the answers; depth is in the mesh's units, inf where nothing is seen."""
    outputs = names(args.outputs)
    points = ray_io.read(args.rays)
    found, evaluated = shape_field.query(shape_field.load(args.field), points, outputs)
    buffer = io.BytesIO()
    arrays: dict[str, Any] = {name: values.astype(np.float32) for name, values in found.items()}
    np.savez(buffer, **arrays)
    storage.write_bytes(args.out, buffer.getvalue())
    total = len(points.positions)
    return {
        "rays": total,
        "evaluated": evaluated,
        "saved": total - evaluated,
        "outputs": list(found),
        "out": args.out.as_posix(),
    }


def names(text: str) -> list[str]:
    """Outputs from a list with commas.

    Raises:
      InputError: one that does not exist.
    """
    outputs = [name.strip() for name in text.split(",") if name.strip()]
    unknown = [name for name in outputs if name not in shape_field.OUTPUTS]
    if unknown or not outputs:
        came = ", ".join(unknown) or "nothing"
        raise checks.InputError(f"--outputs must be among {', '.join(shape_field.OUTPUTS)}; got {came}")
    return outputs
