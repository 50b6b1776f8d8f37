"""Oriented points, what a ray meets, and where it enters a box.

Letters: p position, v unit direction, t distance along v, B axis-aligned box [lower, upper].
Functions of rays take numpy arrays or torch tensors of any float type, and keep library and type.
Files of rays are NPZ: `positions` and `directions`, (N, 3), in the frame of the mesh that they are meant for.
"""

import math
import zipfile
import zlib
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Generic

import numpy as np
from jaxtyping import Bool, Float, Int

from ddf.core import arrays, checks, errors
from ddf.core.arrays import Array

_DAMAGED = (
    *(ValueError, zipfile.BadZipFile, zlib.error, EOFError, OSError),
    *(MemoryError, RuntimeError, LookupError, TypeError, AttributeError, SyntaxError, OverflowError),
)
_FEW, _GROWTH = 64 << 20, 16  # bytes as float64, and those for a byte of the file: claimed without being read


@dataclass(frozen=True)
class OrientedPoints(Generic[Array]):
    """Positions p and unit directions v in one frame, stated by whoever makes them; InputError where shapes differ, a
    value is not finite, or a direction is not of unit length.
    """

    positions: Float[Array, "*batch 3"]
    directions: Float[Array, "*batch 3"]

    def __post_init__(self) -> None:
        checks.require_vectors("positions", self.positions)
        if self.positions.shape != self.directions.shape:
            shapes = f"{tuple(self.positions.shape)} and {tuple(self.directions.shape)}"
            raise checks.InputError(f"positions and directions must have one shape; got {shapes}")
        checks.require_finite("positions", self.positions)
        checks.require_unit("directions", self.directions)


def unit_points(positions: np.ndarray, directions: np.ndarray) -> OrientedPoints[np.ndarray]:
    """As `OrientedPoints`, with directions divided by their lengths: 1e-4 in a length is .1 in a depth of 1000."""
    checked = OrientedPoints(positions, directions)
    return OrientedPoints(checked.positions, directions / np.linalg.norm(directions, axis=-1, keepdims=True))


@dataclass(frozen=True)
class RayHits(Generic[Array]):
    """What each ray p + t v, t >= 0, meets first.

    depth: t, in the unit of the positions; `inf` on a miss.
    visible: true where there is a hit.
    normals: unit normals at the hit, facing back (n·v <= 0); zero on a miss.
    face: index of the triangle hit; -1 on a miss, or where the surface has no triangles.
    """

    depth: Float[Array, "*batch"]
    visible: Bool[Array, "*batch"]
    normals: Float[Array, "*batch 3"]
    face: Int[Array, "*batch"]


def surface_points(
    positions: Float[Array, "*batch 3"], directions: Float[Array, "*batch 3"], depth: Float[Array, "*batch"]
) -> Float[Array, "*batch 3"]:
    """q = p + d v. Source: [DDF22] §3. Not finite on misses: index the visible rays first."""
    return positions + depth[..., None] * directions


def box_span(
    positions: Float[Array, "*batch 3"],
    directions: Float[Array, "*batch 3"],
    lower: Float[Array, "3"],
    upper: Float[Array, "3"],
) -> tuple[Float[Array, "*batch"], Float[Array, "*batch"]]:
    """First and last t >= 0 for which p + t v lies in the closed box (slab test; derived here).

    Exact where a component of v is zero: that slab then holds for all t or for none, and no 0/0 is formed.
    A ray misses the box where `entry > exit`. Inside the box the entry is 0.
    Differentiable in p and v wherever the ray is not exactly parallel to the slab that it enters by.
    """
    xp = arrays.namespace(positions)
    parallel = directions == 0
    inverse = 1.0 / xp.where(parallel, xp.ones_like(directions), directions)
    to_lower, to_upper = (lower - positions) * inverse, (upper - positions) * inverse
    near, far = xp.minimum(to_lower, to_upper), xp.maximum(to_lower, to_upper)
    between = (positions >= lower) & (positions <= upper)
    infinity = xp.full_like(near, xp.inf)
    near = xp.where(parallel, xp.where(between, -infinity, infinity), near)
    far = xp.where(parallel, xp.where(between, infinity, -infinity), far)
    return xp.clip(xp.amax(near, -1), 0.0, None), xp.amin(far, -1)


def enter_box(
    positions: Float[Array, "*batch 3"],
    directions: Float[Array, "*batch 3"],
    lower: Float[Array, "3"],
    upper: Float[Array, "3"],
) -> tuple[Float[Array, "*batch 3"], Float[Array, "*batch"], Bool[Array, "*batch"]]:
    """Move every ray's start to where it enters the box. Source: [DDF22] §3.2 (rendering from outside B).

    Entry points (clamped onto the box, so that far cameras leave no rounding outside it; the start itself where the ray
    misses), the distance travelled (0 inside, and 0 on a miss) and whether the ray meets the box.
    """
    xp = arrays.namespace(positions)
    entry, leave = box_span(positions, directions, lower, upper)
    meets = entry <= leave
    distance = xp.where(meets, entry, xp.zeros_like(entry))
    inside = xp.minimum(xp.maximum(positions + distance[..., None] * directions, lower), upper)
    return xp.where(meets[..., None], inside, positions), distance, meets


def evenly_spread(count: int) -> Float[np.ndarray, "count 3"]:
    """Evenly spread unit vectors (Fibonacci spiral, offset 1/2), without randomness."""
    index = np.arange(count) + 0.5
    height, turn = 1 - 2 * index / count, np.pi * (1 + 5**0.5) * index
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(turn), height, radius * np.sin(turn)], axis=1)


def read_npz(path: Path) -> OrientedPoints[np.ndarray]:
    """Positions and directions of an NPZ file, as float64, directions exactly of unit length."""
    positions, directions = npz_vectors(path, ("positions", "directions"))
    if len(positions) != len(directions):
        raise checks.InputError(f"{path}: {len(positions)} positions but {len(directions)} directions; must be as many")
    try:
        return unit_points(positions, directions)
    except checks.InputError as error:
        raise checks.InputError(f"{path}: {error}") from error


def npz_vectors(path: Path, names: tuple[str, ...]) -> list[np.ndarray]:
    """Named (N, 3) arrays of numbers of an NPZ file, as float64. What headers claim is judged before it is read."""
    found = npz_numbers(path, names)
    for name in names:
        if name not in found:
            raise checks.InputError(f"{path}: has no array {name!r}")
        if found[name].ndim != 2 or found[name].shape[1] != 3:
            raise checks.InputError(f"{path}: {name} must be numbers of shape (N, 3); got shape {found[name].shape}")
    return [found[name] for name in names]


def npz_numbers(path: Path, names: Collection[str], alone: bool = False) -> dict[str, np.ndarray]:
    """Those of the named arrays that an NPZ file has, as float64; as `npz_vectors`, of any shape. If `alone`,
    any other array is refused by its name.
    """
    checks.require_content(path)
    try:
        with zipfile.ZipFile(path) as archive:
            there = [name.removesuffix(".npy") for name in archive.namelist()]
            if alone:
                errors.require_known(str(path), there, names)
            if len(set(there)) < len(there):
                raise checks.InputError(f"{path}: has an array twice, of {', '.join(sorted(there))}")
            return {name: _array(archive, path, name) for name in names if name in there}
    except (checks.InputError, FileNotFoundError):
        raise
    except _DAMAGED as error:
        words = " and ".join(names)
        raise checks.InputError(f"{path}: not a readable NPZ file with {words} ({error or 'too large'})") from error


def _array(archive: zipfile.ZipFile, path: Path, name: str) -> np.ndarray:
    with archive.open(f"{name}.npy") as member:
        version = np.lib.format.read_magic(member)
        header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, by_columns, kind = header(member)
        count = math.prod(shape)
        if kind.kind not in "fiu":
            raise checks.InputError(f"{path}: {name} must be numbers; got {kind} {shape}")
        if 8 * count > max(_FEW, _GROWTH * path.stat().st_size):
            raise checks.InputError(f"{path}: {name} claims {count:,} numbers, too many for a file of this size")
        data = member.read(kind.itemsize * count + 1)
    if len(data) != kind.itemsize * count:
        raise checks.InputError(f"{path}: {name} claims {count:,} numbers and holds another count")
    return np.frombuffer(data, kind).reshape(shape, order="F" if by_columns else "C").astype(np.float64, order="C")
