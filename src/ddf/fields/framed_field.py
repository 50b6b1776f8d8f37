"""What can be asked of a field of one shape, in the frame of its mesh: one code, whatever evaluates the field.

Rays come in the mesh's own frame and unit. They are moved to the field frame in float64, enter the field's box by the
slab test, and are narrowed to float32 only there, so that a camera 1e3 box lengths away costs no precision. Rays that
miss the box are never evaluated. Where the box is missed, or visibility is below 1/2, nothing is seen: depth is `inf`,
every other output is 0.

A field is a `FramedField`: torch (`shape_field`) or onnxruntime (`onnx_field`). Nothing here imports either.
"""

import contextlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from ddf.core import arrays, checks
from ddf.fields import field_outputs
from ddf.geometry import cameras, rays, transforms

SEEN = 0.5  # visibility from which on a surface counts as seen
FRAMED = 0.95  # of a picture's half width, that a framed box takes
CHUNK_RAYS = 16384  # speed and memory only
_UP_FROM_Y = {"y": np.eye(3), "z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])}
UP_AXES = tuple(_UP_FROM_Y)


@runtime_checkable
class FramedField(Protocol):
    """A field of one shape, its box (field frame) and the map to its frame.

    One with a true `enters_its_box` is given all rays as they are, those that miss its box too. Cameras are computed by
    numpy, or by the library of `scalar`, a float64 number, where a field has one.
    """

    @property
    def lower(self) -> Float[np.ndarray, "3"]:
        """Lower corner of the box."""
        ...

    @property
    def upper(self) -> Float[np.ndarray, "3"]:
        """Upper corner of the box."""
        ...

    @property
    def field_from_mesh(self) -> transforms.Similarity:
        """From the frame of the mesh to that of the field."""
        ...

    @property
    def outputs(self) -> tuple[str, ...]:
        """What it can be asked for."""
        ...

    def evaluate(
        self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"], outputs: Collection[str]
    ) -> dict[str, Float[np.ndarray, "n ..."]]:
        """Named outputs inside the box, field frame and unit, whether or not anything is visible."""
        ...


@contextlib.contextmanager
def record_of(file: Path) -> Iterator[None]:
    """Name the file where its record is not what a field needs."""
    try:
        yield
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
        reason = f"no {error}" if isinstance(error, KeyError) else " ".join(str(error).split())
        raise checks.InputError(f"{file}: its record lacks what a field needs ({reason})") from error


def corners(lower: Any, upper: Any) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """The corners of a box as a record has them; ValueError where they are none, or span nothing."""
    low, high = (np.array(corner, dtype=np.float64).reshape(3) for corner in (lower, upper))
    if not (np.isfinite([low, high]).all() and (low < high).all()):
        raise checks.InputError(f"lower must be below upper on every axis; got {low.tolist()} and {high.tolist()}")
    return low, high


def query(
    field: FramedField, points: rays.OrientedPoints, outputs: Collection[str] = field_outputs.DEFAULT
) -> tuple[dict[str, Float[np.ndarray, "n ..."]], int]:
    """Named outputs at oriented points of the mesh's frame, and the number of rays that the field was evaluated for.

    Args:
      points: (n, 3), float64 for far cameras; anywhere, the start need not lie in the box.
      outputs: some of `field.outputs`.
    Returns:
      Arrays by name, with the units of `field_outputs.OUTPUTS`; visibility is 0 where the box is missed.
    """
    positions = field.field_from_mesh.apply(arrays.to_numpy(points.positions))
    directions = field.field_from_mesh.apply_directions(arrays.to_numpy(points.directions))
    found, evaluated = _query_field_frame(field, positions, directions, outputs)
    return in_mesh_frame(found, field.field_from_mesh), evaluated


def in_mesh_frame(found: dict[str, np.ndarray], field_from_mesh: transforms.Similarity) -> dict[str, np.ndarray]:
    """Outputs of the field frame in the frame and the unit of the mesh."""
    scale, turned = field_from_mesh.scale, {}
    for name, values in found.items():
        output = field_outputs.OUTPUTS[name]
        if output.kind == "directions":
            values = field_from_mesh.inverse().apply_directions(values)
        turned[name] = values / scale**output.length if output.length > 0 else values * scale**-output.length
    return turned


def _query_field_frame(
    field: FramedField,
    positions: Float[np.ndarray, "n 3"],
    directions: Float[np.ndarray, "n 3"],
    outputs: Collection[str],
) -> tuple[dict[str, np.ndarray], int]:
    """What `query` gives, everything in the field frame and float64."""
    field_outputs.require(outputs, field.outputs)
    if getattr(field, "enters_its_box", False):
        entry, distance, meets = positions, np.zeros(len(positions)), np.ones(len(positions), bool)
    else:
        entry, distance, meets = rays.enter_box(positions, directions, field.lower, field.upper)
    inside, looking = entry[meets], directions[meets]
    parts = [
        field.evaluate(
            inside[start : start + CHUNK_RAYS], looking[start : start + CHUNK_RAYS], {*outputs, "visibility"}
        )
        for start in range(0, max(1, len(inside)), CHUNK_RAYS)
    ]
    seen = np.zeros_like(meets)
    seen[meets] = np.concatenate([part["visibility"] for part in parts]) >= SEEN
    found = {}
    for name in (name for name in field.outputs if name in outputs):
        values = np.concatenate([part[name] for part in parts]).astype(np.float64)
        kept = meets if name == "visibility" else seen
        found[name] = np.full((len(meets), *values.shape[1:]), np.inf if name == "depth" else 0.0)
        found[name][kept] = values[kept[meets]]
        if name == "depth":
            found[name][kept] += distance[kept]
    return found, int(meets.sum())


def camera_rays(
    field: FramedField, camera: tuple[float, float, float], size: int, up: str = "y"
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
    """Starts and unit directions, field frame, of a camera that looks at the box's centre; rows from the top.

    Args:
      camera: azimuth and elevation in degrees, radius in benchmark units: 0.57 is one diagonal of the box
        (`cameras`, whose lens it has).
      up: the axis of the mesh's frame that points up.
    """
    numbers = arrays.like(np.array(camera, dtype=np.float64), getattr(field, "scalar", np.zeros(())))
    azimuth, elevation, radius = numbers[0], numbers[1], numbers[2]
    xp, pixels = arrays.namespace(numbers), cameras.pixel_directions(size, numbers).reshape(-1, 3)
    centre, world = (
        arrays.to_numpy(part) for part in cameras.pixel_rays(xp.deg2rad(azimuth), xp.deg2rad(elevation), radius, pixels)
    )
    box_centre, unit, turn = _camera_frame(field, up)
    start = unit * (turn @ centre) + box_centre
    return np.broadcast_to(start, world.shape).copy(), world @ turn.T


def camera_at(field: FramedField, position: Float[np.ndarray, "3"], up: str = "y") -> tuple[float, float, float]:
    """Azimuth and elevation (degrees) and radius of the camera of `camera_rays` that stands at a point, field frame."""
    box_centre, unit, turn = _camera_frame(field, up)
    x, y, z = turn.T @ (position - box_centre) / unit
    level = np.hypot(x, z)
    return float(np.degrees(np.arctan2(z, x))), float(np.degrees(np.arctan2(y, level))), float(np.hypot(level, y))


def framing_radius(field: FramedField, azimuth_deg: float, elevation_deg: float, up: str = "y") -> float:
    """The least radius (benchmark units) from which the picture holds the field's box, with a margin (`FRAMED`).

    A corner (x, y, z) in the camera's axes, about the box's centre, is seen at f x / (r - z) from the picture's middle.
    """
    checks.require_finite("camera", np.array([azimuth_deg, elevation_deg]))
    _, unit, turn = _camera_frame(field, up)
    signs = np.array(np.meshgrid(*3 * [(-1.0, 1.0)])).reshape(3, -1).T
    corners = signs * (field.upper - field.lower) / 2 @ turn / unit
    angles = np.deg2rad(np.array([azimuth_deg, elevation_deg]))
    x, y, z = cameras.rotation(angles[0], angles[1]) @ corners.T
    half_angle = FRAMED * cameras.CENTRE_PX / cameras.FOCAL_PX  # tangent of half the angle that the box may take
    return float((z + np.maximum(np.abs(x), np.abs(y)) / half_angle).max())


def upright(up: str) -> Float[np.ndarray, "3 3"]:
    """The axes of the mesh's frame that a camera takes as x, y (up) and z, as columns."""
    if up not in UP_AXES:
        raise checks.InputError(f"up must be among {', '.join(UP_AXES)}; got {up!r}")
    return _UP_FROM_Y[up]


def _camera_frame(field: FramedField, up: str) -> tuple[Float[np.ndarray, "3"], float, Float[np.ndarray, "3 3"]]:
    """The box's centre, field units per benchmark unit, and the rotation from benchmark to field axes."""
    unit = float(np.linalg.norm(field.upper - field.lower)) / transforms.BENCHMARK_FROM_V1
    return (field.lower + field.upper) / 2, unit, field.field_from_mesh.rotation @ upright(up)


def render(
    field: FramedField,
    camera: tuple[float, float, float],
    size: int,
    outputs: Collection[str] = field_outputs.DEFAULT,
    up: str = "y",
) -> tuple[dict[str, Float[np.ndarray, "size size ..."]], int]:
    """Images from one camera (`camera_rays`), as `query` gives them, and the number of rays evaluated; InputError as
    `require_camera`, or of an unknown output.
    """
    require_camera(camera, size, up)
    starts, directions = camera_rays(field, camera, size, up)
    found, evaluated = _query_field_frame(field, starts, directions, outputs)
    found = in_mesh_frame(found, field.field_from_mesh)
    return {name: values.reshape(size, size, *values.shape[1:]) for name, values in found.items()}, evaluated


def require_camera(camera: tuple[float, float, float], size: int, up: str) -> None:
    """Raise InputError when a size is below 1, a radius below 0, an elevation past upright, or an axis unknown."""
    checks.require_finite("camera", np.array(camera))
    if abs(camera[1]) > 90:
        raise checks.InputError(f"a camera's elevation must be in -90..90 degrees; got {camera[1]:g}")
    if size < 1 or camera[2] < 0 or up not in UP_AXES:
        raise checks.InputError(
            f"size must be >= 1, camera radius >= 0, up among {', '.join(UP_AXES)}; got {size}, {camera[2]}, {up}"
        )
