"""`ddf query`: what a fitted field says along given rays, in the frame of the mesh that was fitted."""

import argparse
from typing import Any

from ddf.cli import arguments, image_files
from ddf.fields import field_outputs

EXAMPLES = (
    "ddf query rabbit --rays rays.npz --out answers.npz",
    "ddf query rabbit --rays rays.npz --out answers.npz --outputs depth,mean_curvature",
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
        default=",".join(field_outputs.DEFAULT),
        help=f"some of {','.join(field_outputs.OUTPUTS)} (default %(default)s)",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Query the field and write the answers; depth is in the mesh's units, inf where nothing is seen."""
    from ddf.cli.field import load
    from ddf.core import storage
    from ddf.fields import framed_field
    from ddf.geometry import rays

    points = rays.read_npz(args.rays)
    found, evaluated = framed_field.query(load.framed(args.field, args.outputs), points, args.outputs)
    storage.write_bytes(args.out, image_files.npz(found))
    total = len(points.positions)
    return {
        "rays": total,
        "evaluated": evaluated,
        "saved": total - evaluated,
        "outputs": list(found),
        "out": args.out.as_posix(),
        "verdict": f"{', '.join(found)} of {total:,} rays; {evaluated:,} of them meet the box of the field",
    }
