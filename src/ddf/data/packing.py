"""Oriented-point samples as small integers, and back, and stored clouds; without the packages that draw them.

positions   int16 x 3   value / 32767 per coordinate of the box [-1, 1]^3
directions  int16 x 2   octahedral map of the unit sphere
depth       uint16      steps of 2 sqrt(3) / 65534 (the box's diagonal); 65535 is a miss
normals     int8 x 2    octahedral map; of the hit, on a miss the axis (0, 0, 1), which means nothing; of types S and T
                        that of the surface where the ray starts or touches it
Positions and directions are rounded before rays are cast, so the truth belongs to exactly the stored ray (but of T, see
`samples.extraction`) and only depth and normals carry an error: half a depth step (2.6e-5), and under 1 degree.
Octahedral map: Cigolle et al. 2014, "A survey of efficient representations for independent unit vectors", §3.3.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypedDict

import numpy as np
from jaxtyping import Bool, Float, Int, UInt

from ddf.core import arrays, checks
from ddf.core.arrays import Array
from ddf.geometry import transforms

POSITION_STEPS = 32767
DEPTH_STEP = 2 * 3**0.5 / 65534
MISS = 65535
_LONGEST = (MISS - 0.5) * DEPTH_STEP
FIELDS = ("positions", "directions", "depth", "normals")
RECORD = 7  # int16 of all four codes of a sample


class Samples(TypedDict):
    """Decoded samples of one type, arrays or tensors of float32 but for `visible`; depth is `inf` on a miss."""

    positions: Any
    directions: Any
    depth: Any
    visible: Any
    normals: Any


def records(stored: Mapping[str, np.ndarray], kind: str) -> Int[np.ndarray, "*n record"]:
    """The four codes of each sample of one type side by side, 14 bytes; `parted` reads them."""
    depth, normals = (np.ascontiguousarray(stored[f"{kind}.{field}"]).view(np.int16) for field in ("depth", "normals"))
    parts = stored[f"{kind}.positions"], stored[f"{kind}.directions"], depth[..., None], normals
    return np.concatenate(parts, axis=-1)


def parted(found: Int[Array, "*n record"]) -> dict[str, Any]:
    """What `decode_fields` reads, of `records`."""
    xp = arrays.namespace(found)
    return {
        "positions": found[..., :3],
        "directions": found[..., 3:5],
        "depth": found[..., 5].view(xp.uint16),
        "normals": found[..., 6:].view(xp.int8),
    }


def encode_unit(vectors: Float[np.ndarray, "*n 3"], dtype: type[np.signedinteger]) -> Int[np.ndarray, "*n 2"]:
    """Octahedral code of unit vectors, rounded to the nearest step of `dtype` in the map's plane."""
    return interleaved(unit_steps([vectors[..., axis] for axis in range(3)], dtype), dtype)


def unit_steps(
    axes: Sequence[Float[np.ndarray, "*n"]], dtype: type[np.signedinteger]
) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
    """The two whole numbers of `encode_unit`, of the type of the three coordinates: what `unit_axes` reads."""
    x, y, z = axes
    steps = np.abs(x)
    steps += np.abs(y)
    steps += np.abs(z)
    steps = np.divide(np.iinfo(dtype).max, steps, out=steps)
    folded = np.minimum(z, 0)
    folded *= steps  # below the equator the triangles are turned out: |x| + |z| = 1 - |y|
    found = []
    for own in (x, y):
        code = own * steps
        code += np.copysign(folded, own)
        found.append(np.rint(code, out=code))
    return found[0], found[1]


def decode_unit(codes: Any) -> Any:
    """Unit vectors (*n, 3), float32, of octahedral codes of either width, arrays or tensors, as all that is decoded."""
    xp = arrays.namespace(codes)
    return xp.stack(unit_axes(codes[..., 0], codes[..., 1], xp.iinfo(codes.dtype).max), -1)


def unit_axes(x: Any, y: Any, most: int) -> tuple[Any, Any, Any]:
    """The three coordinates of `decode_unit`, each in memory of its own, of codes from -most to most."""
    xp = arrays.namespace(x)
    x, y = x / np.float32(most), y / np.float32(most)
    z = -xp.abs(x)
    z += 1
    z -= xp.abs(y)
    fold = xp.clip(-z, 0, None)
    x -= xp.copysign(fold, x)
    y -= xp.copysign(fold, y)
    length = x * x
    length += y * y
    length += z * z
    length = xp.sqrt(length)
    x /= length
    y /= length
    z /= length
    return x, y, z


def encode_positions(positions: Float[np.ndarray, "*n 3"]) -> Int[np.ndarray, "*n 3"]:
    """Positions in [-1, 1]^3 as int16; what lies outside is clamped onto the cube."""
    return interleaved([position_steps(positions[..., axis]) for axis in range(3)], np.int16)


def position_steps(positions: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """The whole numbers of `encode_positions`, of the positions' type: what `decode_positions` reads."""
    steps = np.clip(positions, -1.0, 1.0)
    steps *= POSITION_STEPS
    return np.rint(steps, out=steps)


def interleaved(steps: Sequence[Float[np.ndarray, "*n"]], dtype: type[np.signedinteger]) -> Int[np.ndarray, "*n axes"]:
    """Whole numbers of each axis as codes, a point's side by side (numpy is several times slower all at once)."""
    codes = np.zeros((*steps[0].shape, len(steps)), dtype)
    for axis, values in enumerate(steps):
        codes[..., axis] = values
    return codes


def decode_positions(codes: Any) -> Any:
    """Positions in [-1, 1]^3, float32."""
    return codes / np.float32(POSITION_STEPS)


def encode_depth(depth: Float[np.ndarray, "*n"]) -> UInt[np.ndarray, "*n"]:
    """Depths as uint16; `inf` becomes the code of a miss. InputError where another is below 0 or beyond the box's
    diagonal.
    """
    steps = np.rint(depth / DEPTH_STEP)
    codes = np.minimum(steps, MISS)
    misses = np.count_nonzero(depth == np.inf)
    if steps.size and not (steps.min() >= 0 and np.count_nonzero(codes == MISS) == misses):
        hit = depth[np.isfinite(depth)]
        raise checks.InputError(f"depth must be in [0, 2 sqrt(3)] or inf; got {hit.min()} to {hit.max()}")
    return codes.astype(np.uint16)


def decode_depth(codes: Any) -> Any:
    """Depths, float32, `inf` on a miss."""
    depth = codes * np.float32(DEPTH_STEP)
    depth[depth > _LONGEST] = np.inf
    return depth


def decode(stored: Mapping[str, Any], kind: str) -> Samples:
    """Samples of one type out of a shard's arrays, `<kind>.positions` and so on (`FIELDS`), whole or already indexed
    along any leading axes.
    """
    return decode_fields({field: stored[f"{kind}.{field}"] for field in FIELDS})


def decode_fields(codes: Mapping[str, Any]) -> Samples:
    """Samples out of the codes of each of `FIELDS`, of any types together."""
    depth = decode_depth(codes["depth"])
    return Samples(
        positions=decode_positions(codes["positions"]),
        directions=decode_unit(codes["directions"]),
        depth=depth,
        visible=arrays.namespace(depth).isfinite(depth),
        normals=decode_unit(codes["normals"]),
    )


@dataclass(frozen=True)
class Cloud:
    """A true cloud (`true_clouds`): points on a surface, in the mesh's frame, and which are hidden from outside."""

    points: Float[np.ndarray, "n 3"]
    hidden: Bool[np.ndarray, "n"]

    @classmethod
    def stored(cls, shard: Mapping[str, np.ndarray], row: int) -> "Cloud":
        """That of one shape of a shard that the stage `samples` wrote (`sample_shards`)."""
        start, end = shard["offsets"][row : row + 2]
        return cls(shard["points"][start:end], shard["hidden"][start:end].astype(bool))

    def benchmark_points(self) -> Float[np.ndarray, "n 3"]:
        """Points of a mesh in the v1 frame in the benchmark's."""
        return transforms.BENCHMARK_FROM_V1 * self.points.astype(np.float64)
