"""`ddf mesh`: validate a mesh, make it watertight, decimate and normalise it; say what was lost."""

import argparse
from pathlib import Path
from typing import Any

from ddf.cli import arguments
from ddf.data import mesh_config
from ddf.geometry import mesh_io

EXAMPLES = ("ddf mesh shape.obj closed.ply", "ddf mesh shape.obj closed.obj --faces 500 --alpha 0.02")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the two files and the settings of `mesh_preparation.MeshesConfig`."""
    default = mesh_config.MeshesConfig()
    kinds = ", ".join(mesh_io.SUFFIXES)
    parser.add_argument("source", metavar="IN", type=Path, help=f"mesh to read ({', '.join(mesh_io.READ)})")
    arguments.add_out(parser, "out", "OUT", f"mesh to write, in the field frame ({kinds})")
    parser.add_argument(
        "--faces",
        metavar="N",
        type=int,
        default=default.faces,
        help="at most this many triangles (default %(default)s)",
    )
    parser.add_argument(
        "--alpha",
        metavar="A",
        type=float,
        default=default.alpha,
        help="openings narrower than this share of the diagonal are closed (default %(default)g)",
    )
    parser.add_argument(
        "--offset",
        metavar="D",
        type=float,
        default=default.offset,
        help="distance of the wrap from the surface, share of the diagonal (default %(default)g)",
    )
    parser.add_argument(
        "--wrap",
        choices=("auto", "always"),
        default=default.wrap,
        help="auto leaves a mesh alone that is closed already (default %(default)s)",
    )
    parser.add_argument(
        "--close",
        choices=("wrap", "holes"),
        default="wrap",
        help="holes: fill openings first, and wrap only what is still not closed (default %(default)s)",
    )
    parser.add_argument(
        "--opening",
        metavar="W",
        type=float,
        default=1.0,
        help="--close holes fills openings up to this width, share of the diagonal (default %(default)g)",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Prepare the mesh, write it, return the figures; distances are shares of the raw box's diagonal."""
    holes = args.opening if args.close == "holes" else 0.0
    config = mesh_config.MeshesConfig(
        faces=args.faces, alpha=args.alpha, offset=args.offset, wrap=args.wrap, holes=holes
    )
    mesh_io.require_suffix(args.out.suffix)
    raw = mesh_io.load_surface(args.source)
    from ddf.core import (
        seeding,
        storage,  # a bad file is refused before these load 0.9 GiB of packages
    )
    from ddf.data import mesh_preparation

    prepared = mesh_preparation.prepare(raw, config, seeding.generator(config.seed, "measure"))
    storage.write_bytes(args.out, mesh_io.export_bytes(prepared.mesh, args.out.suffix))

    def share(value: float) -> str:
        return f"{100 * value:.2g} % of the diagonal"

    closed = "yes" if prepared.watertight else "NO"
    return {
        "watertight": prepared.watertight,
        "faces": len(prepared.mesh.faces),
        "hausdorff": prepared.hausdorff,
        "mean_distance": prepared.mean_distance,
        **{name: getattr(prepared, name) for name in mesh_config.LOSSES[2:]},
        "wrapped": prepared.wrapped,
        "openings_filled": prepared.openings_filled,
        "faces_raw": len(raw.faces),
        "seconds": round(prepared.seconds, 3),
        "transform": prepared.field_from_raw.to_dict(),
        "left_out": list(raw.remarks),
        "outcome": prepared.verdict,
        "table": {
            "faces": f"{len(prepared.mesh.faces):,} of {len(raw.faces):,}",
            "way": "closed by a wrap" if prepared.wrapped else "closed already, kept as it is",
            "largest distance": share(prepared.hausdorff),
            "of what is seen": share(prepared.hausdorff_seen),
            "mean distance": share(prepared.mean_distance),
            "mean of what is seen": share(prepared.mean_distance_seen),
            "of hidden parts, largest": share(prepared.hausdorff_hidden),
            "of parts cut off, largest": share(prepared.lost),
            "left out": "; ".join(raw.remarks) or "nothing",
            "seconds": prepared.seconds,
        },
        "verdict": f"watertight: {closed}, {len(prepared.mesh.faces):,} faces; {prepared.verdict}",
    }
