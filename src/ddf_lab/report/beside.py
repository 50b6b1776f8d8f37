"""A field beside the truth at the same oriented points, all in the frame and the unit of its mesh: errors and pictures.

What is found is arrays by name, one value a ray: outputs of the field, and `true_depth` and `true_normals`.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping

import numpy as np
from jaxtyping import Float

from ddf.fields import framed_field
from ddf.geometry import rays
from ddf.pictures import field_pictures

Points = rays.OrientedPoints[np.ndarray]
Truth = Callable[[Points], rays.RayHits[np.ndarray]]
Vector = tuple[float, float, float]
TITLES = {  # of pictures
    "visibility": "visibility",
    "depth": "depth",
    "true_depth": "exact depth",
    "normals": "normals",
    "true_normals": "exact normals",
    "mean_curvature": "mean curv.",
    "weight_1": "w₁",
    "normals_1": "n₁",
    "normals_2": "n₂",
}


def camera(field: framed_field.FramedField, looks: Vector, size: int) -> Points:
    """The rays of a camera of `framed_field.camera_rays`."""
    starts, directions = framed_field.camera_rays(field, looks, size)
    back = field.field_from_mesh.inverse()
    return rays.OrientedPoints(back.apply(starts), back.apply_directions(directions))


def corners(field: framed_field.FramedField) -> Float[np.ndarray, "2 3"]:
    """The lower and the upper one of the field's box."""
    return field.field_from_mesh.inverse().apply(np.stack([field.lower, field.upper]))


def plane(field: framed_field.FramedField, level: float, size: int) -> Float[np.ndarray, "n 3"]:
    """Pixels of a plane z = const at a share of the box: x to the right, y upwards, in the square around the box."""
    low, high = corners(field)
    steps = (2 * (np.arange(size) + 0.5) / size - 1) * float((high - low)[:2].max()) / 2
    x, y = np.meshgrid((low[0] + high[0]) / 2 + steps, (low[1] + high[1]) / 2 - steps)
    return np.stack([x, y, np.full_like(x, low[2] + level * (high[2] - low[2]))], axis=-1).reshape(-1, 3)


def along(positions: Float[np.ndarray, "n 3"], direction: Vector) -> Points:
    """All positions with one direction, of any length."""
    return rays.OrientedPoints(positions, np.tile(np.array(direction) / math.hypot(*direction), (len(positions), 1)))


def ask(
    field: framed_field.FramedField, truth: Truth, points: Points, names: Collection[str]
) -> tuple[dict[str, Float[np.ndarray, "n ..."]], int]:
    """What is found at oriented points, with the visibility, and for how many rays the field was evaluated."""
    outputs = {"visibility", *(name for name in names if not name.startswith("true_"))}
    (found, evaluated), hits = framed_field.query(field, points, outputs), truth(points)
    return {**found, "true_depth": hits.depth, "true_normals": hits.normals}, evaluated


def errors(found: Mapping[str, Float[np.ndarray, "n ..."]]) -> dict[str, float]:
    """Median and mean of |depth - exact|, and of normals the median `angle` in degrees, where both see a surface.

    wrong: the share of rays for which one alone does.
    """
    seen, true = (np.isfinite(found[name]) for name in ("depth", "true_depth"))
    both = seen & true
    off = np.abs(found["depth"][both] - found["true_depth"][both])
    values = {"median": float(np.median(off)), "mean": float(off.mean()), "wrong": float((seen != true).mean())}
    if "normals" in found:
        cosine = (found["normals"][both] * found["true_normals"][both]).sum(axis=1)
        values["angle"] = float(np.median(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))))
    return values


def images(found: Mapping[str, Float[np.ndarray, "n ..."]]) -> dict[str, Float[np.ndarray, "size size ..."]]:
    """What is found in a square of rays, as squares."""
    return {name: own.reshape(2 * (math.isqrt(len(own)),) + own.shape[1:]) for name, own in found.items()}


def pictures(found: Mapping[str, Float[np.ndarray, "n ..."]], names: Iterable[str]) -> list[field_pictures.Picture]:
    """Of what is found in a square of rays, with the visibility; depths and true depths are on one colour scale."""
    squares, depths = images(found), ("depth", "true_depth")
    drawn = dict(zip(depths, field_pictures.depth_pictures(*(squares[name] for name in depths)), strict=True))
    seen = np.isfinite(squares["true_depth"]).astype(np.float64)
    drawn["true_normals"] = field_pictures.normals_picture(squares["true_normals"], seen)
    return [drawn[name] if name in drawn else field_pictures.picture(name, squares) for name in names]
