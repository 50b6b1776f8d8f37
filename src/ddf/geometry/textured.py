"""A mesh in the colours of a picture, as a binary glTF file."""

from typing import cast

import numpy as np
from jaxtyping import Float
from PIL import Image

from ddf.geometry.mesh_io import Mesh


def glb(mesh: Mesh, uv: Float[np.ndarray, "n 2"], picture: Image.Image) -> bytes:
    """uv: of each vertex, 0 to 1, x right, y down; the material is rough and no metal."""
    import trimesh
    from trimesh import visual

    how = {"metallicFactor": 0.0, "roughnessFactor": 0.9, "doubleSided": True}
    material = visual.material.PBRMaterial(baseColorTexture=picture, **how)
    drawn = visual.TextureVisuals(np.column_stack([uv[:, 0], 1 - uv[:, 1]]), material)
    whole = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_normals=mesh.normals, visual=drawn, process=False)
    return cast("bytes", whole.export(file_type="glb", include_normals=True))
