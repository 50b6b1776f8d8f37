"""Pictures from a field: one query per pixel, only for rays that meet the box, only the outputs asked for.

Source: [DDF22] §3.2. Cameras are those of `cameras` (benchmark frame); the field lives in the field frame, its box is
[lower, upper]. Depth is along the ray, in the unit of the frame that the function names.
"""

from collections.abc import Collection, Sequence

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ddf.fields import field_outputs, field_values
from ddf.fields.pddf import PDDF
from ddf.geometry import cameras, rays, transforms

CUBE_HALF = 1.0  # conditional fields fill the cube [-1, 1]^3: at test time the shape's own box is not known


def cube(like: Tensor) -> tuple[Float[Tensor, "3"], Float[Tensor, "3"]]:
    """Lower and upper corner of the box of every conditional field."""
    upper = torch.full((3,), CUBE_HALF, dtype=like.dtype, device=like.device)
    return -upper, upper


def field_rays(
    camera: Float[Tensor, "*batch 3"],
    field_scale: Float[Tensor, "*batch"],
    directions: Float[Tensor, "*#batch n 3"],
    field_shift: Float[Tensor, "*batch 3"] | None = None,
) -> tuple[
    Float[Tensor, "*batch n 3"], Float[Tensor, "*batch n 3"], Float[Tensor, "*batch n"], Bool[Tensor, "*batch n"]
]:
    """Pixel rays in the field frame, moved to the cube; differentiable in the camera and the scale.

    Args:
      camera: azimuth and elevation in radians, radius in benchmark units.
      field_scale: field units per v1 unit (`transforms.Similarity.scale` of field from v1).
      directions: camera-frame unit directions (`cameras.pixel_directions`), shared or each camera's own.
      field_shift: where the origin of v1 lies in the field frame (`transforms.Similarity.translation` of field from
        v1); None for its centre, where a shape that is centred in v1 has it.
    Returns:
      Entry points, directions, distance from the camera to the entry (field units), whether the ray meets the cube.
    """
    centre, world = cameras.pixel_rays(camera[..., 0], camera[..., 1], camera[..., 2], directions)
    start = centre * (field_scale / transforms.BENCHMARK_FROM_V1)[..., None]
    if field_shift is not None:
        start = start + field_shift
    start = start[..., None, :].expand_as(world)
    entry, distance, meets = rays.enter_box(start, world, *cube(world))
    return entry, world, distance, meets


@torch.no_grad()
def render(
    field: PDDF,
    modulations: Sequence[Float[Tensor, "1 _"]] | None,
    camera: Float[Tensor, "3"],
    field_scale: Float[Tensor, ""],
    size: int,
    outputs: Collection[str] = field_outputs.DEFAULT,
) -> tuple[dict[str, Tensor], int]:
    """Images of one field from one camera, and the number of queries spent.

    Returns:
      visibility (size, size), 0 where the ray misses the box; depth (size, size) from the camera in field units, `inf`
      where the ray misses the box; normals (size, size, 3) in the field frame, zero where the ray misses the box.
    """
    directions = cameras.pixel_directions(size, camera).reshape(-1, 3)
    entry, world, distance, meets = field_rays(camera, field_scale, directions)
    found = field_values.evaluate(field, entry[meets], world[meets], outputs, modulations)
    images = {}
    for name, values in found.items():
        background = torch.inf if name == "depth" else 0.0
        image = values.new_full((size * size, *values.shape[1:]), background)
        image[meets] = values + distance[meets] if name == "depth" else values
        images[name] = image.reshape(size, size, *values.shape[1:])
    return images, int(meets.sum())
