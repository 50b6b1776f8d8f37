"""Meshes: reading them, and what rays meet on them."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ddf.api import inputs
from ddf.core import checks, extras
from ddf.geometry import mesh_io, rays
from ddf.geometry.mesh_io import Mesh


def read_mesh(path: str | Path) -> Mesh:
    r"""A triangle mesh from an OBJ, PLY, STL, OFF or GLB file.

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
    """A mesh from a mesh, a path, or anything with `vertices` and `faces`.

    Raises:
      InputError: something else. FileNotFoundError: there is no such file.
    """
    if isinstance(mesh, Mesh):
        return mesh
    if isinstance(mesh, str | Path):
        return read_mesh(mesh)
    if not (hasattr(mesh, "vertices") and hasattr(mesh, "faces")):
        raise checks.InputError(f"a mesh must have vertices and faces, or be a path; got {type(mesh).__name__}")
    faces = np.asarray(mesh.faces)
    if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
        raise checks.InputError(f"faces must be whole numbers of shape (m, 3); got {faces.dtype} of {faces.shape}")
    return Mesh(inputs.points("vertices", mesh.vertices), faces)


def cast(mesh: Any, positions: npt.ArrayLike, directions: npt.ArrayLike) -> rays.RayHits[np.ndarray]:
    """What rays meet first on a mesh, exactly. Needs Open3D.

    Args:
      mesh: what `read_mesh` gives, a path, or anything with `vertices` and `faces`.
      positions, directions: (n, 3) in the frame of the mesh; directions of length 1.
    Returns:
      `.depth` (n) float64, in the unit of the mesh, `inf` on a miss; `.visible` (n) bool; `.normals` (n, 3), unit,
      facing back, 0 on a miss; `.face` (n), the triangle met, -1 on a miss.
    Raises:
      ValueError: a wrong shape, a direction that is not of unit length, or Open3D is not installed.

    Example:
      >>> import ddf, types
      >>> triangle = types.SimpleNamespace(vertices=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces=[[0, 1, 2]])
      >>> hits = ddf.cast(triangle, [[0.2, 0.2, 3.0]], [[0, 0, -1]])
      >>> hits.depth.tolist(), hits.visible.tolist(), hits.normals.tolist()
      ([3.0], [True], [[0.0, 0.0, 1.0]])
    """
    asked, surface = inputs.oriented_points(positions, directions), as_mesh(mesh)
    with extras.named():
        from ddf.geometry import exact_cast
    return exact_cast.cast(surface, asked)
