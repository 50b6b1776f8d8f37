"""Fields fitted to a sphere, a box and a torus against the closed forms: normals, mean and Gaussian curvature.

Each is fitted as `ddf fit --config configs/simple_fit.yaml` does it, to a mesh of it, and asked along rays from outside
that look at it. Errors are over the rays where field and closed form both see the surface, without grazing ones. A
curvature's error is relative: that of the mean curvature to |κ1| + |κ2|, that of the Gaussian one to the larger κ². So
1 is 2/r and 1/r² on a sphere of radius r. A box has normals alone, measured away from its edges. It stands askew in its
bounding box; the faces of `box, aligned` are those of its own, but for the margin of the fit. The sphere's mesh is fine
(327,680 triangles): flat faces curve nowhere, and a fit of minutes finds those of a coarse one.
"""

import argparse
import dataclasses
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import trimesh
from torch import Tensor

from bench.lib import display, measuring, side_by_side
from ddf.core import checks, config
from ddf.fields import framed_field
from ddf.fit import fit_settings, fitting, shape_field
from ddf.geometry import mesh_io, primitives, rays

ON_DEMAND = "make fit-proof"
NAME = "primitive_fits"
CONFIG = Path("configs/simple_fit.yaml")
RAYS, DISTANCE = 20_000, 3.0  # rays start on a sphere of so many of the mesh's half diagonals
STEEP = 0.2  # |n·v| from which on a ray does not graze: derivatives of an exact field grow as 1/|n·v|
EDGE = 0.1  # of the box's longest half side: nearer to an edge a smooth field has to round it
TRAINED_TOLERANCE = 1.0  # of errors from run to run: who trains for a time takes as many steps as the machine allows
HALF, TURN = (1.0, 0.7, 0.5), (0.5, 0.4, 0.3)  # of the box; Euler angles in radians


@dataclass(frozen=True)
class Case:
    """A closed form and its mesh. curved: it has curvatures to compare with. turn: from its frame to the mesh's."""

    truth: primitives.Primitive
    mesh: mesh_io.Mesh
    curved: bool
    turn: Tensor = dataclasses.field(default_factory=lambda: torch.eye(3, dtype=torch.float64))

    def own(self, points: rays.OrientedPoints) -> rays.OrientedPoints:
        """Rays of the mesh's frame in that of the closed form."""
        return rays.OrientedPoints(points.positions @ self.turn, points.directions @ self.turn)


def cases() -> dict[str, Case]:
    """The shapes by name."""
    torus = trimesh.creation.torus(0.7, 0.3, major_sections=120, minor_sections=80)
    ring = mesh_io.Mesh(np.array(torus.vertices)[:, [0, 2, 1]], np.array(torus.faces)[:, ::-1])  # around y
    box, ball = trimesh.creation.box(extents=[2 * half for half in HALF]), trimesh.creation.icosphere(subdivisions=7)
    lower, corners, faces = (-HALF[0], -HALF[1], -HALF[2]), np.array(box.vertices), np.array(box.faces)
    turn = trimesh.transformations.euler_matrix(*TURN)[:3, :3]
    truth = primitives.Box(lower, HALF)
    return {
        "sphere": Case(primitives.Sphere(), mesh_io.Mesh(np.array(ball.vertices), np.array(ball.faces)), curved=True),
        "box": Case(truth, mesh_io.Mesh(corners @ turn.T, faces), False, torch.from_numpy(turn)),
        "box, aligned": Case(truth, mesh_io.Mesh(corners, faces), curved=False),
        "torus": Case(primitives.Torus(0.7, 0.3), ring, curved=True),
    }


def looking_at(mesh: mesh_io.Mesh, count: int, seed: int) -> rays.OrientedPoints:
    """Rays from a sphere around the mesh to random points of its box, mesh frame, float64."""
    random = np.random.default_rng(seed)
    lower, upper = mesh.box()
    start = random.standard_normal((count, 3))
    start *= DISTANCE * mesh.diagonal() / 2 / np.linalg.norm(start, axis=1, keepdims=True)
    start += (lower + upper) / 2
    along = random.uniform(lower, upper, (count, 3)) - start
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return rays.OrientedPoints(torch.from_numpy(start), torch.from_numpy(along))


def errors(shape: shape_field.ShapeField, case: Case, points: rays.OrientedPoints) -> dict[str, float]:
    """Medians over the rays that both see (module docstring); depth in units of the mesh."""
    own = case.own(points)
    hits, kappa = primitives.cast(case.truth, own), primitives.curvatures(case.truth, own)
    outputs = ["visibility", "depth", "normals"]
    outputs += ["mean_curvature", "gaussian_curvature"] if case.curved else []
    found = {name: torch.from_numpy(values) for name, values in framed_field.query(shape, points, outputs)[0].items()}
    seen = found["visibility"] >= framed_field.SEEN
    both = seen & hits.visible
    kept = both & ((hits.normals * own.directions).sum(-1).abs() >= STEEP)
    if isinstance(case.truth, primitives.Box):
        kept &= edge_distance(case.truth, rays.surface_points(own.positions, own.directions, hits.depth)) >= EDGE
    angle = torch.rad2deg(torch.acos(((found["normals"] @ case.turn) * hits.normals).sum(-1)[kept].clamp(-1, 1)))
    result = {
        "normal_angle_deg_median": float(angle.median()),
        "normal_angle_deg_p95": float(angle.quantile(0.95)),
        "depth_median": float((found["depth"] - hits.depth)[both].abs().median()),
        "wrong_visibility": float((seen != hits.visible).double().mean()),
    }
    return result | (curvature_errors(found, kappa, kept) if case.curved else {})


def curvature_errors(found: dict[str, Tensor], kappa: Tensor, kept: Tensor) -> dict[str, float]:
    """Median of the relative errors, and how far the median value is from the true one's."""
    first, second = kappa[kept].unbind(-1)
    scales = {"mean": first.abs() + second.abs(), "gaussian": torch.maximum(first.abs(), second.abs()).square()}
    truths = {"mean": first + second, "gaussian": first * second}
    result = {}
    for name, scale in scales.items():
        off = (found[f"{name}_curvature"][kept] - truths[name]) / scale
        result[f"{name}_curvature_median_error"] = float(off.abs().median())
        result[f"{name}_curvature_error_of_median"] = abs(float(off.median()))
    return result


def edge_distance(box: primitives.Box, points: Tensor) -> Tensor:
    """From points of a box's surface to its nearest edge."""
    inside = torch.minimum(points - points.new_tensor(box.lower), points.new_tensor(box.upper) - points).abs()
    return inside.sort(dim=-1).values[..., 1]  # the smallest is that to the point's own face


def measure(name: str, case: Case, section: fit_settings.FitConfig) -> dict[str, Any]:
    """A row: seconds of sampling and training, and the errors."""
    with tempfile.TemporaryDirectory() as folder:
        result = fitting.fit(case.mesh, section, Path(folder))
        shape = shape_field.load(Path(folder))
    found = errors(shape, case, looking_at(case.mesh, RAYS, seed=1))
    size = {"minutes": section.minutes, "rays": RAYS, "triangles": len(case.mesh.faces)}
    row = measuring.row(name, size, [result["seconds"]], found, TRAINED_TOLERANCE)
    return {**row, "steps": result["steps"], "parameters": result["parameters"]}


SECTION = display.Section(elsewhere="../fit_proof/README.md")


def main(given: Sequence[str]) -> None:
    """Fit each shape and write the table; with --only, print the rows of some."""
    known = cases()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, help="of each fit (default: that of configs/simple_fit.yaml)")
    side_by_side.add_rows(parser, known)
    side_by_side.add_options(parser)
    arguments = parser.parse_args(given)
    section = config.load(CONFIG, "fit", fit_settings.FitConfig)
    minutes = section.minutes if arguments.minutes is None else arguments.minutes
    if minutes is None or not minutes > 0:
        raise checks.InputError(f"--minutes must be > 0; got {minutes}")
    threads = side_by_side.threads(arguments, section.loop.threads)
    section = side_by_side.budgeted(section, minutes, threads)
    names = arguments.only or list(known)
    if arguments.side_by_side > 1:
        given = ["--minutes", str(minutes), "--threads", str(threads)]
        rows = side_by_side.rows(NAME, names, given, arguments.side_by_side)
    else:
        rows = [measure(name, known[name], section) for name in names]
    side_by_side.deliver(NAME, arguments, threads, rows)
