"""Whether a shape's mesh, camera and image belong together: a silhouette cast of the mesh against the image's alpha.

Roots of another kind would train without a word: meshes turned (ShapeNetCore.v2), scaled, or of other ids; angles in
radians. One view of a shape costs some 10 ms.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from PIL import Image
from scipy import ndimage

from ddf.core import checks
from ddf.geometry import cameras, mesh_io, raycast, transforms

LEAST = 0.95  # good roots have 1.00; shapes that look alike from all sides may pass in a wrong one, a root of them not
_OPAQUE = 128  # of 255


class View(NamedTuple):
    """An image (RGBA, a path) and its camera as the metadata have it: degrees and benchmark units."""

    image: str
    azimuth_deg: float
    elevation_deg: float
    radius: float


def require(mesh: mesh_io.Mesh, view: View) -> float:
    """The overlap of the silhouette of a mesh, as of ShapeNet v1, with the image's alpha.

    Raises:
      InputError: it is less than `LEAST`; likely causes are named.
    """
    with Image.open(view.image) as image:
        seen = np.asarray(image.getchannel("A")) >= _OPAQUE
    scene, camera = raycast.Scene(mesh), np.array(view[1:])
    radians = cameras.degrees_to_radians(camera)
    found = overlap(silhouette(scene, transforms.Similarity(), radians), seen)
    if found >= LEAST:
        return found
    raise checks.InputError(
        f"its silhouette overlaps that of {view.image} by {found:.2f}, not {LEAST}: both must be of one shape, the "
        "mesh as in ShapeNetCore.v1 (v2's are turned), centred with a diagonal of 1, the camera's angles in degrees"
    )


def overlap(cast: Bool[np.ndarray, "h w"], seen: Bool[np.ndarray, "h w"]) -> float:
    """Intersection over union, up to one pixel: edges are drawn softly, and thin parts are little else."""
    near_cast, near_seen = (ndimage.binary_dilation(mask, np.ones((3, 3))) for mask in (cast, seen))
    union = int((cast | seen).sum())
    return 1.0 - int((cast & ~near_seen | seen & ~near_cast).sum()) / union if union else 0.0


def silhouette(
    scene: raycast.Scene, v1_from_mesh: transforms.Similarity, camera: Float[np.ndarray, "3"]
) -> Bool[np.ndarray, "h w"]:
    """Where a camera (radians, benchmark units) sees a mesh that is moved to the frame v1 first."""
    pixels = cameras.pixel_directions(cameras.IMAGE_SIZE, camera).reshape(-1, 3)
    centre, along = cameras.pixel_rays(camera[0], camera[1], camera[2], pixels)
    mesh_from_v1 = v1_from_mesh.inverse()
    start = mesh_from_v1.apply(centre / transforms.BENCHMARK_FROM_V1)
    _, face = scene.first_hits(np.broadcast_to(start, along.shape), mesh_from_v1.apply_directions(along))
    return (face >= 0).reshape(cameras.IMAGE_SIZE, cameras.IMAGE_SIZE)
