"""`ddf query`: what a fitted field says along given rays, in the frame of the mesh that was fitted."""

import argparse
import io
from typing import Any

from ddf.cli import arguments

EXAMPLES = (
    "ddf query chair_field --rays rays.npz --out answers.npz",
    "ddf query chair_field --rays rays.npz --out answers.npz --outputs depth,mean_curvature",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare field, rays and outputs."""
    arguments.add_field(parser)
    arguments.add_rays(parser, "mesh")
    arguments.add_out(parser, "--out", "OUT.npz", "gets one array per output")
    parser.add_argument(
        "--outputs",
        metavar="NAME,...",
        type=arguments.outputs,
        default="visibility,depth,normals",
        help=f"some of {','.join(arguments.OUTPUTS)} (default %(default)s)",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Query the field and write the answers; depth is in the mesh's units, inf where nothing is seen."""
    import numpy as np

    from ddf.core import storage
    from ddf.fields import framed_field
    from ddf.geometry import ray_io
    from ddf.shape import shape_field

    points = ray_io.read(args.rays)
    found, evaluated = framed_field.query(shape_field.load(args.field), points, args.outputs)
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
        "verdict": f"{', '.join(found)} of {total:,} rays; {evaluated:,} of them meet the box of the field",
    }
