"""`ddf samples`: the six types of oriented-point samples of a mesh."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddf.cli import arguments, results

if TYPE_CHECKING:
    from ddf.geometry import mesh_io, transforms

EXAMPLES = ("ddf samples shape.obj samples.safetensors --count 2000",)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the files and how many samples; the defaults are those of single shapes in [DDF22]."""
    parser.add_argument("mesh", metavar="MESH", type=Path, help="mesh file; sampled as it is, in the field frame")
    arguments.add_out(parser, "out", "OUT.safetensors", "gets <type>.positions, ... (docs/formats.md)")
    parser.add_argument(
        "--seed", metavar="S", type=int, default=0, help="equal seeds, equal bytes (default %(default)s)"
    )
    parser.add_argument(
        "--count", metavar="N", type=int, default=250_000, help="of types U and A; the others N/2 (default %(default)s)"
    )
    parser.add_argument(
        "--epsilon",
        metavar="E",
        type=float,
        default=0.05,
        help="offset of O samples, field units (default %(default)g)",
    )
    parser.add_argument(
        "--box", choices=("tight", "cube"), default="tight", help="the shape's box or [-1, 1]^3 (default %(default)s)"
    )
    parser.add_argument(
        "--watertight", action="store_true", help="close and decimate the mesh first, as `ddf mesh` does"
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Sample the mesh and write the samples; returns the counts, hit shares and packing errors."""
    from ddf.core import checks

    if args.count < 2:
        raise checks.InputError(f"--count must be >= 2; got {args.count}")
    import numpy as np

    from ddf.core import storage
    from ddf.data.samples import extraction, sample_types
    from ddf.geometry import mesh_io

    config = extraction.SamplesConfig(
        counts={kind: args.count if kind in "UA" else args.count // 2 for kind in sample_types.KINDS},
        epsilon_o=args.epsilon,
        offsets="fixed",
        box=args.box,
        seed=args.seed,
    )
    raw = mesh_io.load_surface(args.mesh)
    mesh, field_from_raw = _field_mesh(raw, args.watertight)
    arrays, probes = extraction.extract(mesh, config)
    metadata = {
        "seed": args.seed,
        "sources": {args.mesh.name: storage.checksum(args.mesh)},
        "field_from_raw": field_from_raw.to_dict(),
        "packing_errors": extraction.packing_errors([probes]),
    }
    storage.save_tensors(args.out, arrays, metadata)
    counts = config.counts
    shares = {kind: float(np.mean(arrays[f"{kind}.depth"] != np.iinfo(np.uint16).max)) for kind in counts}
    return {
        "counts": counts,
        "hit_share": shares,
        **metadata,
        "left_out": list(raw.remarks),
        "out": args.out.as_posix(),
        "table": results.grid(
            ("type", "samples", "hit"), [(kind, count, f"{shares[kind]:.1%}") for kind, count in counts.items()]
        ),
        "verdict": f"{sum(counts.values()):,} samples in {args.out}{results.left_out(raw.remarks)}",
    }


def _field_mesh(raw: "mesh_io.Mesh", watertight: bool) -> "tuple[mesh_io.Mesh, transforms.Similarity]":

    from ddf.core import seeding
    from ddf.geometry import mesh_io, transforms

    if watertight:
        from ddf.data import mesh_preparation

        config = mesh_preparation.MeshesConfig()
        prepared = mesh_preparation.prepare(raw, config, seeding.generator(config.seed, "measure"))
        return prepared.mesh, prepared.field_from_raw
    field_from_raw = transforms.field_from_mesh(raw.surface_vertices())
    solid = mesh_io.without_flat(raw)
    return mesh_io.Mesh(field_from_raw.apply(solid.vertices), solid.faces), field_from_raw
