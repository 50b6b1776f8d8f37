"""Commands about one field: fit it, ask it, draw points and triangles on it."""

import dataclasses
import logging
import os
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from ddf.cli import arguments, results
from ddf.cli.arguments import FieldPath, Outputs, Points, Rays, Seed
from ddf.cli.declare import Arg, command
from ddf.core import errors
from ddf.fields import field_outputs

if TYPE_CHECKING:
    from ddf.geometry import mesh_io, posed_depth

_POSES = "are their poses right?"  # of what `posed_depth` remarks
_DRAWN = 10_000  # points of each surface that is compared


@command("field", api="field:fit")
def fit(
    mesh: Annotated[Path, Arg("SOURCE")],
    out: arguments.OutFolder,
    *,
    config: Annotated[str | None, Arg("C")] = None,
    kind: Literal["patches", "sine"] | None = None,
    tolerance: Annotated[float | None, Arg("T")] = None,
    minutes: Annotated[float | None, Arg("M", group="budget")] = None,
    steps: Annotated[int | None, Arg("N", group="budget")] = None,
    seed: Seed | None = None,
    up: arguments.Up | None = None,
    onto: Annotated[Path | None, Arg("FIELD")] = None,
    force: bool = False,
) -> dict[str, Any]:
    """Fit a field to a mesh, with held-out errors and a picture beside the mesh, or to what a sensor saw.

    Sensors: posed depth images in a folder as TUM RGB-D, nerfstudio (`transforms.json`) and Redwood (`depth/`, a .log)
    write it; scans as of `ddf complete`, one or a folder; clouds: KITTI .bin, PCD, PLY and LAS with normals.

    | `--kind` | the field | needs |
    | --- | --- | --- |
    | `patches`, the default | small planes and paraboloids in an octree, about `--tolerance` from the mesh | seconds |
    | `sine` | the network; of rays, wrong where none went (bench `from_depth`) | `--minutes`, `--steps`: imply it |

    Args:
      mesh: mesh file, fitted as it is, inner sheets included; or rays.
      out: gets model.safetensors, fit.json, of a mesh fit.png, of a network log.csv; a network's fit goes on there.
      config: of sine: simple_fit, long_fit, paper_fit, or a file with a section `fit` (default: fit).
      seed: of sine: of samples, initial weights and batches.
      up: axis that points up (default y, or FIELD's); pictures and pages of the folder take it from fit.json.
      onto: of rays: what FIELD was fitted to, read once more, counts too; OUT_DIR may be the same.
      force: replace the field of another mesh in OUT_DIR.

    Examples:
      ddf fit shape.obj my_field
      ddf fit shape.obj my_field --minutes 2
      ddf fit shape.obj my_field --steps 2000 --seed 1
      ddf fit rgbd_dataset_freiburg1_xyz my_room
      ddf fit more_scans my_room --onto my_room
    """
    from ddf.core import storage
    from ddf.fit import patch_fitting
    from ddf.geometry import mesh_io, posed_depth

    options = {"config": config, "minutes": minutes, "steps": steps, "seed": seed}
    of_sine = [name for name, value in options.items() if value is not None]
    if kind == "patches" and of_sine:
        raise errors.InputError(f"--{of_sine[0]} is of --kind sine; patches take --tolerance alone")
    if (kind == "sine" or of_sine) and tolerance is not None:
        raise errors.InputError("--tolerance is of --kind patches")
    of_rays = posed_depth.is_rays(mesh)
    if onto is not None and not of_rays:
        raise errors.InputError(f"--onto adds rays to those of a field; {mesh} is a mesh")
    earlier, up = ([], up or "y") if onto is None else _rays_of(onto, up)
    given = [*(each for each in earlier if each.resolve() != mesh.resolve()), mesh]
    force = force or (onto is not None and onto.resolve() == out.resolve())
    if kind != "sine" and not of_sine:
        if of_rays:
            found, sources = _sensed(given)
            result = patch_fitting.fit_rays(found.scan, tolerance, out, sources, sensed=found.sensed, force=force)
            return _of_rays(found, given, out, up, result, f"{result['patches']:,} patches, {result['bytes']:,} bytes")
        from ddf.fields.grid import octree

        patches = octree.PatchConfig.within(tolerance)
        if not any(Path(str(octree.__file__)).parent.glob("__pycache__/*.nbi")):
            results.show_parts()
            logging.getLogger(__name__).info("compiling, which takes 20 s or so, once after each installation")
        loaded = mesh_io.load_surface(mesh)
        result = patch_fitting.fit(loaded, patches, out, {mesh.name: storage.checksum(mesh)}, force=force)
        spent = f"{result['patches']:,} patches, {result['bytes']:,} bytes"
        return _inspected(out, loaded, up, result, spent, f"{result['seconds']:.1f} s, {spent}")
    from ddf.api import field as fields
    from ddf.fit import fitting

    settings = fields.network_settings(minutes, steps, config)
    if seed is not None:
        settings = dataclasses.replace(settings, loop=dataclasses.replace(settings.loop, seed=seed))
    cut = settings.steps is None  # by the clock
    used = threads_of(settings.loop.threads, cut)
    if of_rays:
        found, sources = _sensed(given, network=True)
        result = fitting.fit(found.scan, settings, out, sources, threads=used, force=force)
        told = _of_rays(found, given, out, up, result, f"{result['steps']:,} steps{_few(result['steps'])}")
    else:
        loaded = mesh_io.load_surface(mesh)
        result = fitting.fit(loaded, settings, out, {mesh.name: storage.checksum(mesh)}, threads=used, force=force)
        spent = f"{result['steps']:,} steps in {result['seconds']:.0f} s"
        after = f"{spent}{_few(result['steps'])}"
        told = _inspected(out, loaded, up, result, f"{spent}; more --minutes go on from there", after)
    return told | {"doubtful": told.get("doubtful") or (cut and result["steps"] < fitting.FEW_STEPS)}


def _few(steps: int) -> str:
    """What is said of a network that had too few steps."""
    from ddf.fit import fitting

    return f"; FEWER than {fitting.FEW_STEPS} steps: blurred, give it more minutes" * (steps < fitting.FEW_STEPS)


def _rays_of(field: Path, up: arguments.Up | None) -> tuple[list[Path], arguments.Up]:
    """What a field was fitted to, and what is up unless it is told; InputError where that was no rays, or is gone."""
    from ddf.core import storage
    from ddf.fit import fit_folder

    told = storage.read_json(field / fit_folder.METRICS)
    said = told.get("rays") if isinstance(told, dict) else None
    if not isinstance(said, list):
        raise errors.InputError(f"{field}: was not fitted to rays, to which others could be added")
    if gone := [each for each in said if not (field / each).exists()]:
        raise errors.InputError(f"{field}: was fitted to {', '.join(gone)}, seen from there, which is gone")
    return [field / each for each in said], up or told.get("up", "y")


def _sensed(given: list[Path], network: bool = False) -> tuple["posed_depth.Sensed", dict[str, str]]:
    """What sensors saw, which is told before the work, and the checksums of the sources."""
    from ddf.core import storage
    from ddf.geometry import posed_depth

    results.show_parts()
    found = posed_depth.together([posed_depth.read(each) for each in given])
    if network:
        found.require_sensed()
    logging.getLogger(__name__).info(found.told)
    return found, {each.name: storage.checksum(each) for each in given}


def _of_rays(
    found: "posed_depth.Sensed", given: list[Path], out: Path, up: arguments.Up, result: dict[str, Any], spent: str
) -> dict[str, Any]:
    """The result of a fit to rays with a table and a verdict; fit.json names them for `--onto`, and what is up."""
    from ddf.core import storage
    from ddf.fit import fit_folder
    from ddf.geometry import posed_depth

    already, off, remarks = result.pop("already"), result["held_out"], list(found.scan.remarks)
    result |= {"rays": posed_depth.seen_from(out, given), "up": up, "remarks": remarks}
    doubts = [each for each in remarks if _POSES in each]
    storage.write_json(out / fit_folder.METRICS, result)
    return {
        **result,
        "understood": found.told,
        "left_out": remarks,
        "doubtful": bool(doubts),
        "table": {
            "held-out rays": off["rays"],
            "median |depth - range|": off["depth_median"],
            "wrong": f"{off['wrong']:.2%}",
            "noise": result["noise"],
            "space seen": f"{result['seen']:.0%}",
        },
        "verdict": f"field in {out}{', made before' if already else ''}: {result['seconds']:.1f} s, {spent}"
        + "".join(f"; DOUBTFUL: {each}" for each in doubts),
    }


def _inspected(
    out: Path, mesh: "mesh_io.Mesh", up: arguments.Up, result: dict[str, Any], already: str, after: str
) -> dict[str, Any]:
    """The result with how the field looks beside the mesh: a picture, a table and a verdict."""
    from ddf.core import storage
    from ddf.fields import stored_fields
    from ddf.fit import fit_folder, inspection

    picture, looks = out / inspection.PICTURE, result.get("looks")
    verdict = f"{out}: fitted already, {already}" if result.pop("already") else f"field in {out} after {after}"
    if looks is None or not picture.is_file() or result.get("up") != up:
        field = stored_fields.load(out)
        truth = inspection.beside(field, mesh)
        looks = inspection.measure(field, truth)
        storage.write_bytes(picture, results.encode([inspection.picture(field, truth, up)], picture.suffix))
        result["up"] = up
        storage.write_json(out / fit_folder.METRICS, {**result, "looks": looks})
    return {
        **result,
        "looks": looks,
        "left_out": list(mesh.remarks),
        "table": results.grid(("beside the mesh", "value", "unit", "that is"), inspection.verdicts(looks)),
        "verdict": f"{verdict}; field above mesh in {picture}" + results.left_out(mesh.remarks),
    }


def threads_of(configured: int, timed: bool) -> int:
    """Threads of the fit. A fit by steps takes those of its config, for they are part of the result."""
    limit = os.environ.get("OMP_NUM_THREADS", "")
    threads = min(configured, int(limit)) if limit.isdigit() and int(limit) else configured
    if timed and hasattr(os, "getloadavg"):
        idle = (os.cpu_count() or 1) - round(os.getloadavg()[0])
        threads = min(threads, max(1, idle))
    return threads


@command("field", api="queries:query")
def query(
    field: FieldPath,
    *,
    rays: Rays,
    out: Annotated[Path, Arg("OUT.npz", writes="file")],
    outputs: Outputs = field_outputs.DEFAULT,
    seen: bool = False,
) -> dict[str, Any]:
    """What a field says along given rays: depth, visibility, normals, curvatures.

    Depth is in the unit of the mesh, `inf` where nothing is seen.

    Args:
      out: gets one array per output.
      seen: of a field that was fitted to rays: an array `seen` too, whether these saw all the way up to the answer.

    Examples:
      ddf query rabbit --rays rays.npz --out answers.npz
      ddf query rabbit-network --rays rays.npz --out answers.npz --outputs depth,mean_curvature
    """
    import numpy as np

    from ddf.api import field as fields
    from ddf.api import queries
    from ddf.core import storage
    from ddf.fields import framed_field
    from ddf.geometry import rays as ray_files

    points = ray_files.read_npz(rays)
    queries.require_near(points.positions)
    shape = fields.load(field)
    found, evaluated = framed_field.query(shape.framed, points, outputs)
    if seen:
        found["seen"] = shape.seen(points.positions, points.directions)
    storage.write_bytes(out, results.npz(found))
    total = len(points.positions)
    meet = int(ray_files.enter_box(points.positions, points.directions, *shape.box)[2].sum())  # patches take all rays
    other = "" if meet else results.other_units("rays'", points.positions, "field's", np.array(shape.box))
    return {
        "rays": total,
        "evaluated": evaluated,
        "saved": total - evaluated,
        "outputs": list(found),
        "verdict": f"{', '.join(found)} of {total:,} rays; {meet:,} of them meet the box of the field{other}",
    }


@command("field", api="field:points")
def points(
    field: FieldPath,
    out: Annotated[Path, Arg("OUT.ply", writes="file")],
    *,
    points: Points = 5000,
    seed: Seed = 0,
) -> dict[str, Any]:
    """A point cloud on the surface of a field, with its outward normals.

    Args:
      out: gets points and the field's normals there, in the mesh's frame.

    Examples:
      ddf points rabbit cloud.ply -n 2000
    """
    from ddf.api import field as fields
    from ddf.core import storage
    from ddf.geometry import mesh_io

    if out.suffix.lower() != ".ply":
        raise errors.InputError(f"{out}: must end in .ply")
    shape = fields.load(field)
    started = time.monotonic()
    found, normals = shape.points(points, seed, normals=True)
    seconds = time.monotonic() - started
    storage.write_bytes(out, mesh_io.points_ply(found, normals))
    unknown = int((normals == 0).all(axis=1).sum())
    words = f"with normals of the field {field.name}"
    if unknown:
        words += f" (0, 0, 0 at the {unknown:,} that it sees from no side)"
    return {
        "points": len(found),
        "normals": f"field {field}",
        "without_normal": unknown,
        "seconds": round(seconds, 4),
        "table": {"lower corner": found.min(axis=0), "upper corner": found.max(axis=0), "seconds": seconds},
        "verdict": f"{len(found):,} point{'s' * (len(found) != 1)} {words} in {out}",
    }


@command("field", api="queries:udf")
def udf(
    field: FieldPath,
    *,
    points: Annotated[Path, Arg("P.npz")],
    out: Annotated[Path, Arg("U.npz", writes="file")],
) -> dict[str, Any]:
    """Unsigned distances from points to the surface of a field, and the directions of its closest point.

    Args:
      points: positions: (N, 3), in the mesh's frame.
      out: gets distances (N) in mesh units, directions (N, 3).

    Examples:
      ddf udf rabbit --points rays.npz --out distances.npz
    """
    import numpy as np

    from ddf.api import field as fields
    from ddf.core import storage
    from ddf.geometry import rays as ray_files

    (positions,) = ray_files.npz_vectors(points, ("positions",))
    shape = fields.load(field)
    distances, directions = shape.udf(positions)
    lower, upper = shape.box
    beside = not ((lower <= positions) & (positions <= upper)).all(axis=1).any()
    storage.write_bytes(out, results.npz({"distances": distances, "directions": directions}))
    least, most = (float(f(distances)) if len(distances) else float("nan") for f in (np.min, np.max))
    return {
        "points": len(distances),
        "method": "cloud",
        "least": least,
        "largest": most,
        "verdict": f"distances of {len(distances):,} points, in mesh units, in {out}"
        + (results.other_units("points'", positions, "field's", np.array(shape.box)) if beside else ""),
    }


@command("field", api="field:surface")
def surface(
    field: FieldPath,
    out: Annotated[Path, Arg("OUT", writes="file")],
    *,
    method: Literal["udf", "closed", "poisson"] = "udf",
    points: Annotated[int, Arg("N", parse=arguments.whole_number(100, 20_000), like="n")] = 5000,
    resolution: Annotated[int, Arg("N", parse=arguments.whole_number(8, 256))] = 64,
    truth: Annotated[Path | None, Arg("MESH")] = None,
) -> dict[str, Any]:
    """A triangle mesh of a field: with open and inner sheets, watertight, or smooth.

    `--truth` tells the mean distance between both surfaces (`chamfer_l1`, the true mesh's longest side is 2) and the
    mean |n · n'| (`normal_consistency`).

    Args:
      out: gets the triangles (.ply, .obj, .stl, .off, .glb), in the frame of the mesh that was fitted.
      truth: the true mesh, in the same frame: scores are told.

    Examples:
      ddf surface rabbit rabbit.ply
      ddf surface my_field mesh.ply --truth shape.obj
    """
    import numpy as np

    from ddf.api import field as fields
    from ddf.data import mesh_topology
    from ddf.geometry import mesh_io

    mesh_io.require_suffix(out.suffix)
    true = None if truth is None else mesh_io.load_surface(truth)
    shape = fields.load(field)
    other = "" if true is None else results.other_units("true mesh's", true.vertices, "field's", np.array(shape.box))
    sys.stderr.write(f"{truth}{other}\n" if other else "")
    started = time.monotonic()
    mesh = shape.surface(points, method, resolution)
    seconds = time.monotonic() - started
    mesh.save(out)
    result: dict[str, Any] = {
        "method": method,
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "watertight": bool(mesh_topology.is_watertight(mesh)),
        "seconds": round(seconds, 3),
    }
    verdict = f"{len(mesh.faces):,} triangles in {out}"
    if out.suffix.lower() == ".stl" and (origin := mesh_io.told_origin(mesh.vertices)).any():
        verdict += f", whose coordinates are less {', '.join(map(str, origin))}, as its header tells"
    if true is not None:
        from ddf.data.samples import draws
        from ddf.geometry import raycast
        from ddf.metrics import cloud_scores

        unit = 2 / float(np.ptp(true.surface_vertices(), axis=0).max())
        same = [mesh_io.Mesh(unit * each.vertices, each.faces) for each in (mesh, true)]
        scores = cloud_scores.compare_meshes(same[0], same[1])
        drawn = [draws.Surface.of(each).draw(_DRAWN, np.random.default_rng(0))[0] for each in same]
        away = [float(raycast.Scene(a).distance(b).mean()) for a, b in zip(same, reversed(drawn), strict=True)]
        result |= {
            "chamfer_l1": sum(away) / 2,
            "chamfer_l2_sq": scores.clouds.chamfer_l2_sq,
            "normal_consistency": scores.normal_consistency,
        }
        verdict += f"; {sum(away) / 2:.5f} from the truth on average, whose longest side is 2"
    return result | {"verdict": verdict}
