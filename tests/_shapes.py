"""Small meshes and rays for the geometry tests."""

import numpy as np
import torch
import trimesh

from ddf.geometry import mesh_io, rays


def icosphere(level: int, radius: float = 1.0) -> mesh_io.Mesh:
    """Subdivided icosahedron with its corners on the sphere."""
    shape = trimesh.creation.icosphere(subdivisions=level, radius=radius)
    return mesh_io.Mesh(np.array(shape.vertices), np.array(shape.faces))


def cube(half: float = 1.0) -> mesh_io.Mesh:
    """The surface of [-half, half]^3, 12 triangles, wound outwards."""
    shape = trimesh.creation.box(extents=(2 * half,) * 3)
    return mesh_io.Mesh(np.array(shape.vertices), np.array(shape.faces))


def torus(major: float = 0.7, minor: float = 0.3, sections: int = 48) -> mesh_io.Mesh:
    """A torus around the y axis."""
    shape = trimesh.creation.torus(major, minor, major_sections=sections, minor_sections=sections)
    vertices = np.array(shape.vertices)[:, [0, 2, 1]]
    return mesh_io.Mesh(vertices, np.array(shape.faces)[:, ::-1])


def joined(*parts: mesh_io.Mesh) -> mesh_io.Mesh:
    """Several meshes as one soup."""
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    faces = [part.faces + offset for part, offset in zip(parts, offsets, strict=True)]
    return mesh_io.Mesh(np.concatenate([part.vertices for part in parts]), np.concatenate(faces))


def moved(mesh: mesh_io.Mesh, scale: float | np.ndarray, shift: tuple[float, float, float]) -> mesh_io.Mesh:
    """The mesh scaled (along each axis), then shifted."""
    return mesh_io.Mesh(mesh.vertices * scale + np.array(shift), mesh.faces)


def float32(mesh: mesh_io.Mesh) -> mesh_io.Mesh:
    """As a GPU holds it."""
    return mesh_io.Mesh(mesh.vertices.astype(np.float32), mesh.faces)


def random_rays(count: int, seed: int, spread: float = 1.0) -> rays.OrientedPoints:
    """Positions uniform in a cube, directions uniform on the sphere."""
    rng = np.random.default_rng(seed)
    directions = rng.standard_normal((count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return rays.OrientedPoints(torch.from_numpy(rng.uniform(-spread, spread, (count, 3))), torch.from_numpy(directions))
