"""`ddf fit`: a field for one mesh, as it is, with held-out errors per sample type."""

import argparse
import dataclasses
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddf.cli import arguments, results

if TYPE_CHECKING:
    from ddf.geometry import mesh_io

EXAMPLES = (
    "ddf fit shape.obj my_field",
    "ddf fit shape.obj my_field --minutes 2",
    "ddf fit shape.obj my_field --steps 2000 --seed 1",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare mesh, folder and budget."""
    parser.add_argument("mesh", metavar="MESH", type=Path, help="mesh file; fitted as it is, inner sheets included")
    arguments.add_folder(
        parser, "gets model.safetensors, log.csv, fit.json, fit.png; an interrupted or longer fit goes on there"
    )
    parser.add_argument(
        "--config", metavar="C", help="simple_fit, long_fit, paper_fit, or a file with a section `fit` (default: fit)"
    )
    parser.add_argument(
        "--kind",
        choices=("patches", "sine"),
        help="patches: small curved pieces in an octree, in seconds; sine: a network, which takes all options below "
        "and is the default where one of them is given (default: patches)",
    )
    parser.add_argument(
        "--tolerance",
        metavar="T",
        type=float,
        help="of patches: largest distance from the mesh, of half its longest side (default 3e-4)",
    )
    budget = parser.add_mutually_exclusive_group()
    budget.add_argument(
        "--minutes", metavar="M", type=float, help="wall time of sampling and training, which the schedule follows"
    )
    budget.add_argument("--steps", metavar="N", type=int, help="number of steps: the reproducible way")
    parser.add_argument("--seed", metavar="S", type=int, help="of samples, initial weights and batches")
    parser.add_argument(
        "--threads",
        metavar="N",
        type=arguments.whole_number(1),
        help="of the CPU (default: the config's; with --minutes no more than stand idle, and never more than "
        "OMP_NUM_THREADS)",
    )
    parser.add_argument("--force", action="store_true", help="replace the field of another mesh in OUT_DIR")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Fit the mesh; returns the held-out errors, times and sizes, as fit.json has them."""
    from ddf.core import checks, config, storage
    from ddf.fit import fit_settings, fitting

    of_sine = [name for name in ("config", "minutes", "steps", "seed", "threads") if getattr(args, name) is not None]
    kind = args.kind or ("sine" if of_sine else "patches")
    if kind == "patches" and of_sine:
        raise checks.InputError(f"--{of_sine[0]} is of --kind sine; patches take --tolerance alone")
    if kind == "sine" and args.tolerance is not None:
        raise checks.InputError("--tolerance is of --kind patches")
    if kind == "patches":
        return _patches(args)
    fit = (
        fit_settings.FitConfig()
        if args.config is None
        else config.load(config.found_file(args.config), "fit", fit_settings.FitConfig)
    )
    if args.minutes is not None:
        fit = dataclasses.replace(fit, steps=None, minutes=args.minutes)
    if args.steps is not None:
        fit = dataclasses.replace(fit, steps=args.steps, minutes=None)
    if args.seed is not None:
        fit = dataclasses.replace(fit, loop=dataclasses.replace(fit.loop, seed=args.seed))
    mesh = _mesh(args)
    how = {"threads": _threads(fit.loop.threads, args.threads, fit.steps is None), "force": args.force}
    result = fitting.fit(mesh, fit, args.out, {args.mesh.name: storage.checksum(args.mesh)}, **how)
    spent = f"{result['steps']:,} steps in {result['seconds']:.0f} s"
    verdict = f"{args.out}: fitted already, {spent}; more --minutes go on from there"
    if not result["already"]:
        verdict = f"field in {args.out} after {spent}{_few(result)}"
    return _answer(args, mesh, result, verdict)


def _patches(args: argparse.Namespace) -> dict[str, Any]:
    """As `run`, of patches."""
    from ddf.core import storage
    from ddf.fields.grid import octree
    from ddf.fit import patch_fitting

    config = octree.PatchConfig() if args.tolerance is None else octree.PatchConfig(tolerance=args.tolerance)
    mesh = _mesh(args)
    source = {args.mesh.name: storage.checksum(args.mesh)}
    result = patch_fitting.fit(mesh, config, args.out, source, force=args.force)
    size = f"{result['patches']:,} patches, {result['bytes']:,} bytes"
    verdict = f"{args.out}: fitted already, {size}"
    if not result["already"]:
        verdict = f"field in {args.out} after {result['seconds']:.1f} s, {size}"
    return _answer(args, mesh, result, verdict)


def _mesh(args: argparse.Namespace) -> "mesh_io.Mesh":
    from ddf.geometry import mesh_io

    return mesh_io.load_surface(args.mesh)


def _answer(args: argparse.Namespace, mesh: "mesh_io.Mesh", result: dict[str, Any], verdict: str) -> dict[str, Any]:
    """The result with how the field looks beside the mesh: a picture, a table and a verdict."""
    from ddf.cli import image_files
    from ddf.core import storage
    from ddf.fields import stored_fields
    from ddf.fit import fitting, inspection

    picture, looks = args.out / inspection.PICTURE, result.get("looks")
    del result["already"]
    if looks is None or not picture.is_file():
        field = stored_fields.load(args.out)
        truth = inspection.beside(field, mesh)
        looks = inspection.measure(field, truth)
        storage.write_bytes(picture, image_files.encode(inspection.picture(field, truth), picture.suffix))
        storage.write_json(args.out / fitting.METRICS, {**result, "looks": looks})
    return {
        **result,
        "looks": looks,
        "left_out": list(mesh.remarks),
        "out": args.out.as_posix(),
        "table": results.grid(("beside the mesh", "value", "unit", "that is"), inspection.verdicts(looks)),
        "verdict": f"{verdict}; field above mesh in {picture}" + results.left_out(mesh.remarks),
    }


def _threads(configured: int, asked: int | None, timed: bool) -> int:
    """Threads of the fit. A fit by steps takes those of its config, for they are part of the result."""
    if asked is not None:
        return asked
    limit = os.environ.get("OMP_NUM_THREADS", "")
    threads = min(configured, int(limit)) if limit.isdigit() and int(limit) else configured
    if timed and hasattr(os, "getloadavg"):
        idle = (os.cpu_count() or 1) - round(os.getloadavg()[0])
        threads = min(threads, max(1, idle))
    return threads


def _few(result: dict[str, Any]) -> str:
    """The part of the verdict on a fit that was too short."""
    from ddf.fit import fitting

    if result["steps"] >= fitting.FEW_STEPS:
        return ""
    return f"; FEWER than {fitting.FEW_STEPS} steps: blurred, give it more minutes"
