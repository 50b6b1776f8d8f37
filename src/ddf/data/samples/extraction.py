"""Oriented-point samples of a mesh: the six types of [DDF22] appendix A, their truth by ray casting, packed.

Letters: B the box, S the surface, q0 a point uniform by area on S with normal n0, v0 the direction that a sample looks
back along. Each function of `draws` gives positions and directions only; `extract` rounds them to their stored form,
casts exactly those rays and packs the answers. Everything is in the field frame. Draws are float32, of which a stored
step has 256; their memory holds one coordinate after the other.

Choices where the paper is silent:
- S starts on the surface. It is lifted by `raycast.SURFACE_OFFSET` (1e-5 of half the box's longest side) off its own
  triangle, to the side that v points to, and the depth is corrected for that: its own triangle, and others in its
  plane, cannot be the hit; a second sheet closer than that is not seen.
- T is cast as it is stored, as [DDF22] does: it passes q0 on either side, by the rounding of the ray and by the facets,
  and of a convex shape misses as often as it hits.
- S and T keep the normal at q0, along which L_T asks for a transition, not that of the hit.
- O: the offset line is shortened where q0 + s eps n0 would leave B (the other side is tried first), then p is drawn on
  the line's part inside B as for T. So p is in B always, and a tenth lies on its boundary exactly.
- Hits from behind count. Triangles without an area get no samples.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import tqdm
from jaxtyping import Float, Int

from ddf.core import checks, schema, seeding
from ddf.core.schema import fixed, setting
from ddf.data import packing
from ddf.data.samples import draws, sample_types
from ddf.data.samples.draws import Surface
from ddf.geometry import raycast
from ddf.geometry.mesh_io import Mesh


@dataclass(frozen=True)
class SamplesConfig(schema.Checked):
    """Section `samples`: what is drawn from each shape.

    epsilon_o: distance of O samples from the tangent line, in field units (0.05 single shape, 0.02 ShapeNet).
    offsets: every O sample at that distance ("fixed"), or uniform up to it ("uniform"; "maximum" in [DDF22] app. D).
    box: the cube [-1, 1]^3 ("cube"), for the shape's own is unknown at test time, or that ("tight"), `margin` field
    units wider on every side.
    """

    counts: dict[str, int] = setting(
        {"U": 20_000, "A": 20_000, "B": 10_000, "S": 10_000, "T": 10_000, "O": 10_000},
        "samples per shape",
        "app. si3dr",
    )
    epsilon_o: float = fixed(0.02, above=0, below=1)
    offsets: Literal["fixed", "uniform"] = "uniform"
    box: Literal["cube", "tight"] = "cube"
    margin: float = fixed(0.0, least=0, below=1)
    cloud_points: int = setting(8000, "of the true cloud of a shape, met within 10 %", least=10, most=1_000_000)
    seed: int = fixed(0, least=0)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "counts", sample_types.stored("counts", self.counts))


def extract(mesh: Mesh, config: SamplesConfig, *names: str, describe: str | None = None) -> dict[str, np.ndarray]:
    """All six types of one shape in stored form: `<type>.positions`, `.directions`, `.depth`, `.normals` (`packing`).

    Args:
      mesh: in the field frame; InputError where it leaves [-1, 1]^3, or no triangle has an area.
      names: what tells this shape's random stream from others (category, id).
      describe: title of a progress bar; None for none.
    """
    scene = raycast.Scene(mesh)
    domain, codes = domain_of(scene, config), _codes_of_sides(scene)
    arrays, shown = {}, {"desc": describe, "disable": describe is None}
    with tqdm.tqdm(total=sum(config.counts.values()), unit="ray", unit_scale=True, **shown) as progress:
        for kind, count in config.counts.items():
            drawn = sample_types.DRAWS[kind](domain, count, seeding.generator(config.seed, *names, kind))
            packed = _cast_and_pack(scene, drawn, codes)
            arrays |= {f"{kind}.{field}": values for field, values in packed.items()}
            progress.update(count)
    return arrays


def domain_of(scene: raycast.Scene, config: SamplesConfig) -> draws.Domain:
    """What samples of a mesh are drawn from; InputError where it leaves the cube or has no triangle with an area."""
    mesh = scene.mesh
    if np.abs(mesh.vertices).max(initial=0.0) > 1 + 1e-6 and np.abs(np.stack(mesh.box())).max() > 1 + 1e-6:
        raise checks.InputError(f"the mesh must lie in [-1, 1]^3; got {mesh.box()[0]} to {mesh.box()[1]}")
    uniform = config.offsets == "uniform"
    return draws.Domain(surface_of(scene), box_of(mesh, config), config.epsilon_o, uniform)


def box_of(mesh: Mesh, config: SamplesConfig) -> draws.Box:
    """The box that a mesh's samples are drawn in; InputError where the margin makes it leave the cube."""
    if config.box == "cube":
        return draws.CUBE
    lower, upper = mesh.box()
    if max(-lower.min(), upper.max()) + config.margin > 1 + 1e-6:
        raise checks.InputError(f"a margin of {config.margin} leaves [-1, 1]^3; the mesh spans {lower} to {upper}")
    return draws.Box(lower - config.margin, upper + config.margin)


def surface_of(scene: raycast.Scene) -> Surface:
    """What `draws` draw from: the triangles of a scene in float32. InputError where none has an area."""
    corners = scene.mesh.vertices.astype(np.float32)[scene.mesh.faces]
    return Surface(corners, scene.normals.astype(np.float32), scene.areas)


def _cast_and_pack(scene: raycast.Scene, drawn: draws.Draw, codes: Int[np.ndarray, "sides 2"]) -> dict[str, np.ndarray]:
    """Samples of one type rounded to their stored form and cast.

    Coordinates lie one after the other: along an axis of three numpy is slow.
    """
    positions = packing.position_steps(drawn.positions.T)
    starts = packing.decode_positions(positions)
    directions = packing.unit_steps(list(drawn.directions.T), np.int16)
    looking = packing.unit_axes(*directions, np.iinfo(np.int16).max)
    ahead = _lift(scene.scale, drawn, starts, looking) if drawn.starts_on else 0.0
    behind = 0.0 if drawn.starts_on else raycast.SURFACE_OFFSET  # a mesh that touches its box is met where rays enter
    local = np.zeros((len(drawn.positions), 6), np.float32)
    for axis, centre in enumerate(scene.centre.astype(np.float32)):
        np.divide(starts[axis] - centre, np.float32(scene.scale), out=local[:, axis])
        local[:, 3 + axis] = looking[axis]
    depth, kept = scene.cast_local(local, behind)
    depth = np.maximum((depth * scene.scale).astype(np.float32) + ahead, 0)
    return {
        "positions": packing.interleaved(list(positions), np.int16),
        "directions": packing.interleaved(directions, np.int16),
        "depth": packing.encode_depth(depth),
        "normals": _normal_codes(codes, kept, scene.normals[scene.kept], looking)
        if drawn.normals is None
        else packing.encode_unit(drawn.normals, np.int8),
    }


def _lift(
    size: float, drew: draws.Draw, starts: Float[np.ndarray, "3 n"], looking: Sequence[np.ndarray]
) -> Float[np.ndarray, "n"]:
    """Lift starts on the surface off their triangles to the side that they look to, in place; how far, by ray."""
    assert drew.normals is not None
    normals = drew.normals.T
    slope = np.sum([normal * v for normal, v in zip(normals, looking, strict=True)], axis=0)
    lift = np.copysign(np.float32(raycast.SURFACE_OFFSET * size), slope)
    ahead = np.zeros(len(slope), np.float32)
    for start, position, normal, v in zip(starts, drew.positions.T, normals, looking, strict=True):
        lifted = position + lift * normal
        ahead += (lifted - start) * v
        start[:] = lifted
    return ahead


def _codes_of_sides(scene: raycast.Scene) -> Int[np.ndarray, "sides 2"]:
    """Normals in stored form of the triangles that rays meet, then of their other sides, then of a miss: 0."""
    sides = scene.normals[scene.kept].T.astype(np.float32)
    codes = packing.encode_unit(np.concatenate([sides, -sides], axis=1).T, np.int8)
    return np.concatenate([codes, np.zeros((1, 2), np.int8)])


def _normal_codes(
    codes: Int[np.ndarray, "sides 2"],
    kept: Int[np.ndarray, "n"],
    normals: Float[np.ndarray, "k 3"],
    looking: Sequence[np.ndarray],
) -> Int[np.ndarray, "n 2"]:
    """Codes of `raycast.facing_back`, the axis (0, 0, 1) on a miss."""
    slope = sum(normals[:, axis][kept] * looking[axis] for axis in range(3))
    which = np.where(kept < 0, -1, kept + (slope > 0) * len(normals))
    return codes.view(np.int16)[which, 0].view(np.int8).reshape(-1, 2)
