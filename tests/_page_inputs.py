"""The small files that examples in help and pages name: a mesh, a scene, rays, a listing and two clouds."""

import json
from pathlib import Path

import _shapes
import numpy as np

from ddf.geometry import mesh_io

_SCENE = Path(__file__).parents[1] / "examples" / "scene.yaml"


def write(folder: Path) -> None:
    """shape.obj, scene.yaml, rays.npz, ids.json, cloud.ply and truth.ply."""
    mesh = _shapes.icosphere(2, 0.8)
    (folder / "shape.obj").write_bytes(mesh_io.export_bytes(mesh, ".obj"))
    (folder / "scene.yaml").write_bytes(_SCENE.read_bytes())
    starts = np.array([[0.0, 0.2, 3.0], [0.1, 0.3, 3.0], [3.0, 0.2, 0.0], [3.0, 5.0, 0.0]])
    ahead = np.array([[0.0, 0.0, -1.0]] * 2 + [[-1.0, 0.0, 0.0]] * 2)
    np.savez(folder / "rays.npz", positions=starts, directions=ahead)
    (folder / "ids.json").write_text(json.dumps({"03001627": [f"shape{i}" for i in range(5)]}))
    generator = np.random.default_rng(0)
    for name, noise in (("cloud", 0.005), ("truth", 0.0)):
        points = mesh.vertices[:160] + noise * generator.standard_normal((160, 3))
        (folder / f"{name}.ply").write_bytes(mesh_io.points_ply(points))
