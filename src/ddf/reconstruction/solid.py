"""The mesh of a field that a picture shows, closed, from the field, its cloud and the picture's own outline.

The field is looked at from all sides (`carved_surface`) and once more, with more weight, by the picture's camera. What
projects beside the object is empty. Where an opaque pixel has nothing behind it, the likeliest nodes along its rays are
filled in, if enough looks agree: legs that the field nearly sees stay. Small parts go, but those that the picture shows
where nothing else is.
"""

import numpy as np
from jaxtyping import Float, UInt8
from scipy import ndimage

from ddf.core import checks
from ddf.fields import framed_field
from ddf.fit import surfaces
from ddf.geometry import cameras, carved_surface, transforms
from ddf.geometry.mesh_io import Mesh

OPAQUE = 128  # of 255
_CELLS = 80  # along the longest side
_MARGIN = 0.05  # of the cloud's longest side, around it
_OWN = 4.0  # weight of the picture's camera, in looks from a side
_GROWN, _STEEP, _ASKED = 0.15, 1.5, 2.0  # cells beside the outline: of its surface, its slope, how far nodes matter
_LIKELY, _AS_LIKELY = 2.5, 0.3  # cells: nodes that are filled in, and how much those of a ray may differ
_AROUND, _WEIGHT = 2.5, 2.0  # cells around a node whose mean makes it likelier, and the weight of that mean
_LEAST, _SHOWN = 0.01, 20  # of the largest part; nodes that alone explain their pixels


def solid(
    field: framed_field.FramedField,
    cloud: Float[np.ndarray, "n 3"],
    camera: tuple[float, float, float],
    alpha: UInt8[np.ndarray, "s s"],
) -> Mesh:
    """The closed surface, frame of v1.

    Args:
      cloud: points on the surface; no part of it lies far from them. camera: azimuth, elevation (radians) and radius
        (benchmark units) of the picture. alpha: of the picture.
    Raises:
      InputError: nothing is left, or the picture shows nothing there.
    """
    lower, upper = surfaces.box(field)
    margin = _MARGIN * np.ptp(cloud, axis=0).max()
    grid = carved_surface.Grid.around(
        np.maximum(lower, cloud.min(axis=0) - margin), np.minimum(upper, cloud.max(axis=0) + margin), _CELLS
    )
    rotation, centre = cameras.extrinsics(*np.array(camera))
    start, nodes = centre / transforms.BENCHMARK_FROM_V1, grid.nodes()
    scale = cameras.FOCAL_PX * grid.cell / float(np.linalg.norm(start))  # pixels a cell, about
    place = np.stack(cameras.project(nodes * transforms.BENCHMARK_FROM_V1, rotation, centre)[::-1])
    beside = _beside(alpha >= OPAQUE, scale, place)
    chosen = np.flatnonzero(beside < _ASKED)
    if not len(chosen):
        raise checks.InputError("the picture's object is not where the model places its shape: give another picture")
    beside, place = beside[chosen] - _GROWN, place[:, chosen]
    votes, look = carved_surface.Votes(grid, chosen), surfaces.look(field)
    votes.look_around(look)
    size = int(cameras.IMAGE_SIZE / scale)
    row, column = np.clip((place / scale).astype(int), 0, size - 1)
    pixel = row * size + column  # as large as a cell
    used, back = np.unique(pixel, return_inverse=True)
    directions = cameras.directions_at(*(scale * (np.stack(divmod(used, size)[::-1]) + 0.5))) @ rotation
    seen = look(np.broadcast_to(start, directions.shape).copy(), directions)
    votes.add(seen[back] - np.linalg.norm(nodes[chosen] - start, axis=1), _OWN)
    found, outside = votes.mean() - carved_surface.LEVEL, _STEEP * beside
    found = np.maximum(found, outside)
    covered = np.bincount(pixel[found < 0], minlength=size**2) > 0
    bare = ~ndimage.binary_closing(covered.reshape(size, size)).ravel()[pixel]
    whole = np.full(np.prod(grid.shape), carved_surface.REACH, np.float32)
    whole[chosen] = found
    around = ndimage.gaussian_filter(whole.reshape(grid.shape), _AROUND, truncate=2).ravel()[chosen]
    likely = found + _WEIGHT * around
    best = np.full(size**2, np.inf, found.dtype)
    np.minimum.at(best, pixel, likely)
    filled = bare & (beside < 0) & (likely < best[pixel] + _AS_LIKELY) & (found < _LIKELY - carved_surface.LEVEL)
    found = np.where(filled, np.maximum(np.minimum(found, -0.5), outside), found)
    values = np.full(np.prod(grid.shape), carved_surface.REACH, np.float32)
    values[chosen] = found
    part, count = ndimage.label((values < 0).reshape(grid.shape), np.ones((3, 3, 3)))
    part = part.ravel()[chosen]
    sizes = np.bincount(part, minlength=count + 1)
    large = sizes >= _LEAST * sizes[1:].max(initial=0)
    explained = np.bincount(pixel[large[part] & (part > 0)], minlength=size**2) > 0
    large |= np.bincount(part[~explained[pixel]], minlength=count + 1) >= _SHOWN
    values[chosen[~large[part]]] = carved_surface.REACH
    return carved_surface.surface(grid, values.reshape(grid.shape))


def _beside(opaque: np.ndarray, scale: float, place: Float[np.ndarray, "2 n"]) -> Float[np.ndarray, "n"]:
    """How far beside the object places (row, column in `cameras`' pixels) are, in cells; negative within."""
    ratio = len(opaque) / cameras.IMAGE_SIZE
    rim = int(np.ceil((_ASKED + 1) * scale * ratio))
    framed = np.pad(opaque, rim)
    out, within = (ndimage.distance_transform_edt(each) for each in (~framed, framed))
    signed = np.where(framed, 0.5 - within, out - 0.5).astype(np.float32) / (scale * ratio)
    return ndimage.map_coordinates(signed, place * ratio - 0.5 + rim, order=1, mode="nearest", output=np.float32)
