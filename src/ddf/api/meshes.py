"""Meshes and clouds: reading them, what rays meet on them, how near they are."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ddf.api import queries
from ddf.core import checks
from ddf.geometry import mesh_io, raycast, rays
from ddf.geometry.mesh_io import Mesh
from ddf.metrics import cloud_scores


def read_mesh(path: str | Path) -> Mesh:
    r"""A triangle mesh from an OBJ, PLY, STL, OFF, GLB, glTF, DAE, 3MF or AC3D file.

    Returns:
      `.vertices` (n, 3) float64, untouched, and `.faces` (m, 3), indices into them; polygons are cut into triangles.
    Raises:
      FileNotFoundError: there is no such file.
      ValueError: the file is damaged, holds no triangles, or has another suffix; it is named.

    Example:
      >>> import ddf, pathlib, tempfile
      >>> file = pathlib.Path(tempfile.mkdtemp(), "triangle.obj")
      >>> _ = file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
      >>> mesh = ddf.read_mesh(file)
      >>> mesh.vertices.shape, mesh.faces.tolist()
      ((3, 3), [[0, 1, 2]])
    """
    return mesh_io.load(Path(path))


def as_mesh(mesh: Any) -> Mesh:
    """A mesh from a mesh, a path, or anything with `vertices` and `faces`."""
    if isinstance(mesh, Mesh):
        return mesh
    if isinstance(mesh, str | Path):
        return read_mesh(mesh)
    if not (hasattr(mesh, "vertices") and hasattr(mesh, "faces")):
        raise checks.InputError(f"a mesh must have vertices and faces, or be a path; got {type(mesh).__name__}")
    faces = np.asarray(mesh.faces)
    if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
        raise checks.InputError(f"faces must be whole numbers of shape (m, 3); got {faces.dtype} of {faces.shape}")
    return Mesh(queries.require_points("vertices", mesh.vertices), faces)


def cast(mesh: Any, positions: npt.ArrayLike, directions: npt.ArrayLike) -> rays.RayHits[np.ndarray]:
    """What rays meet first on a mesh, exactly.

    Args:
      mesh: what `read_mesh` gives, a path, or anything with `vertices` and `faces`.
      positions, directions: (n, 3) in the frame of the mesh; directions of length 1.
    Returns:
      `.depth` (n) float64, in the unit of the mesh, `inf` on a miss; `.visible` (n) bool; `.normals` (n, 3), unit,
      facing back, 0 on a miss; `.face` (n), the triangle met, -1 on a miss.
    Raises:
      ValueError: a wrong shape, or a direction that is not of unit length.

    Example:
      >>> import ddf, types
      >>> triangle = types.SimpleNamespace(vertices=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces=[[0, 1, 2]])
      >>> hits = ddf.cast(triangle, [[0.2, 0.2, 3.0]], [[0, 0, -1]])
      >>> hits.depth.tolist(), hits.visible.tolist(), hits.normals.tolist()
      ([3.0], [True], [[0.0, 0.0, 1.0]])
    """
    asked, surface = queries.require_oriented_points(positions, directions), as_mesh(mesh)
    return raycast.cast(surface, asked)


def compare(
    pred: npt.ArrayLike, truth: npt.ArrayLike, tau_sq: float = cloud_scores.TAU_SQ, relative: bool = False
) -> cloud_scores.CloudScores:
    """Chamfer distance and F-scores of two clouds.

    Args:
      pred, truth: (n, 3) and (m, 3), in one frame and unit.
      tau_sq: threshold on the squared distance: a point is hit when its own is not larger; meant for benchmark units.
      relative: lengths are shares of the diagonal of the truth's box, the threshold too.
    Returns:
      `.chamfer_l2_sq`, the sum of both means of squared distances; `.f_score_tau`, `.f_score_2tau`, `.precision_tau`
      and `.recall_tau` in [0, 1]; `.num_pred`, `.num_truth`.
    Raises:
      ValueError: a shape that is not (n, 3), a value that is not finite, an empty cloud, tau_sq not positive, or
        lengths relative to a truth that is a single point.

    Example:
      >>> import ddf
      >>> scores = ddf.compare([[0.0, 0.0, 0.0]], [[0.0, 0.0, 0.005]])
      >>> round(scores.chamfer_l2_sq, 6), scores.f_score_tau
      (5e-05, 1.0)
    """
    found, true, unit = queries.require_points("pred", pred), queries.require_points("truth", truth), 1.0
    if relative and len(true):
        unit = float(np.linalg.norm(np.ptp(true, axis=0)))
        if not unit > 0:
            raise checks.InputError("truth: all points are one, so nothing is relative to its box")
    return cloud_scores.compare_clouds(found / unit, true / unit, tau_sq)
