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

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
import tqdm
from jaxtyping import Float, Int, UInt

from ddf.core import checks, schema, seeding
from ddf.core.schema import fixed, setting
from ddf.data import packing
from ddf.data.samples import draws, sample_types
from ddf.data.samples.draws import Surface
from ddf.geometry import raycast
from ddf.geometry.mesh_io import Mesh

_ERROR_PROBE = 100  # samples of each type whose packing error is measured


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


def draw(
    kind: str,
    surface: Surface,
    box: draws.Box,
    config: SamplesConfig,
    count: int,
    rng: np.random.Generator,
) -> draws.Draw:
    """`count` oriented points of one type, not yet rounded."""
    domain = draws.Domain(surface, box, config.epsilon_o, config.offsets == "uniform")
    return sample_types.DRAWS[kind](domain, count, rng)


@dataclass(frozen=True)
class Probes:
    """Some samples of one or more shapes whose errors are measured (`packing_errors`).

    drawn: before rounding. packed: in stored form. depth: `inf` on a miss. normals: before coding.
    """

    drawn: draws.Draw
    packed: dict[str, np.ndarray]
    depth: Float[np.ndarray, "n"]
    normals: Float[np.ndarray, "n 3"]


def extract(
    mesh: Mesh, config: SamplesConfig, *names: str, describe: str | None = None
) -> tuple[dict[str, np.ndarray], Probes]:
    """All six types of one shape in stored form, and some of them for `packing_errors`.

    Args:
      mesh: in the field frame (inside [-1, 1]^3).
      names: what tells this shape's random stream from others (category, id).
      describe: title of a progress bar, under which types are cast one after the other, not all at once; None for none.
    Returns:
      `<type>.positions`, `.directions`, `.depth`, `.normals` (see `packing`), and the first samples of each type.
    Raises:
      InputError: the mesh leaves the cube, or has no triangle with an area.
    """
    counts = config.counts
    streams = {kind: seeding.generator(config.seed, *names, kind) for kind in counts}
    scene = raycast.Scene(mesh)
    sampler = Sampler(scene, config)
    portions = [counts] if describe is None else [{kind: count} for kind, count in counts.items()]
    arrays, probes, shown = {}, [], {"desc": describe, "disable": describe is None}
    with tqdm.tqdm(total=sum(counts.values()), unit="ray", unit_scale=True, **shown) as progress:
        for portion in portions:
            answers = sampler.cast(portion, streams)
            arrays |= answers.arrays()
            probes.append(_probes(scene, answers))
            progress.update(sum(portion.values()))
    return arrays, _together(probes)


@dataclass(frozen=True)
class Answers:
    """What samples of several types became, one type after the other.

    drawn: before rounding. packed: in stored form. depth: float32, `inf` on a miss. kept: see
    `raycast.Scene.cast_kept`. looking: stored directions.
    """

    drawn: dict[str, draws.Draw]
    packed: dict[str, np.ndarray]
    depth: Float[np.ndarray, "n"]
    kept: UInt[np.ndarray, "n"]
    looking: Float[np.ndarray, "n 3"]

    def arrays(self) -> dict[str, np.ndarray]:
        """`<type>.<field>` in stored form."""
        parts = parts_of(self.drawn).items()
        return {f"{kind}.{field}": values[part] for kind, part in parts for field, values in self.packed.items()}


@dataclass(frozen=True)
class Rounded:
    """Samples of several types as they are stored and cast, one type after the other; coordinates in whole rows.

    drawn: before rounding. positions, directions: the whole numbers of their stored form. starts: where rays are cast
    from, of S lifted off the surface. looking: decoded directions. ahead: of S, how far the start is along the ray.
    """

    drawn: dict[str, draws.Draw]
    positions: Float[np.ndarray, "3 n"]
    directions: tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]
    starts: Float[np.ndarray, "3 n"]
    looking: list[Float[np.ndarray, "n"]]
    ahead: dict[str, Float[np.ndarray, "_"]]


class Sampler:
    """What samples of one mesh are drawn from and cast on, made once for as many draws as wanted.

    Raises:
      InputError: the mesh leaves the cube, or has no triangle with an area.
    """

    def __init__(self, scene: raycast.Scene, config: SamplesConfig) -> None:
        mesh = scene.mesh
        if np.abs(mesh.vertices).max(initial=0.0) > 1 + 1e-6 and np.abs(np.stack(mesh.box())).max() > 1 + 1e-6:
            raise checks.InputError(f"the mesh must lie in [-1, 1]^3; got {mesh.box()[0]} to {mesh.box()[1]}")
        self.scene, self.config = scene, config
        self._surface, self._box = surface_of(scene), box_of(mesh, config)

    def cast(self, counts: Mapping[str, int], streams: Mapping[str, np.random.Generator]) -> Answers:
        """So many samples of each type, each drawn from its own stream, rounded and cast."""
        return _cast_and_pack(self.scene, self._rounded(counts, streams))

    def _rounded(self, counts: Mapping[str, int], streams: Mapping[str, np.random.Generator]) -> Rounded:
        """Samples in their stored form, one coordinate after the other: along an axis of three numpy is slow."""
        drawn = {
            kind: draw(kind, self._surface, self._box, self.config, count, streams[kind])
            for kind, count in counts.items()
        }
        parts = parts_of(drawn)
        positions = packing.position_steps(_joined(drawn, "positions"))
        starts = packing.decode_positions(torch.from_numpy(positions.T)).numpy().T
        directions = packing.unit_steps(list(_joined(drawn, "directions")), np.int16)
        x, y = (torch.from_numpy(steps) for steps in directions)
        looking = [axis.numpy() for axis in packing.unit_axes(x, y, np.iinfo(np.int16).max)]
        ahead = {
            kind: _lift(self.scene.scale, drew, starts[:, parts[kind]], [axis[parts[kind]] for axis in looking])
            for kind, drew in drawn.items()
            if drew.starts_on
        }
        return Rounded(drawn, positions, directions, starts, looking, ahead)


def box_of(mesh: Mesh, config: SamplesConfig) -> draws.Box:
    """The box that a mesh's samples are drawn in.

    Raises:
      InputError: the margin makes it leave the cube, so that points on its sides could not be stored.
    """
    if config.box == "cube":
        return draws.CUBE
    lower, upper = mesh.box()
    if max(-lower.min(), upper.max()) + config.margin > 1 + 1e-6:
        raise checks.InputError(f"a margin of {config.margin} leaves [-1, 1]^3; the mesh spans {lower} to {upper}")
    return draws.Box(lower - config.margin, upper + config.margin)


def surface_of(scene: raycast.Scene) -> Surface:
    """What `draws` draw from: the triangles of a scene in float32.

    Raises:
      InputError: no triangle has an area.
    """
    corners = scene.mesh.vertices.astype(np.float32)[scene.mesh.faces]
    return Surface(corners, scene.normals.astype(np.float32), scene.areas)


def parts_of(drawn: dict[str, draws.Draw]) -> dict[str, slice]:
    """Where each type lies when all are put after another."""
    ends = itertools.accumulate((len(drew.positions) for drew in drawn.values()), initial=0)
    return {kind: slice(*pair) for kind, pair in zip(drawn, itertools.pairwise(ends), strict=True)}


def _cast_and_pack(scene: raycast.Scene, rays: Rounded) -> Answers:
    """All types in one cast."""
    parts, drawn = parts_of(rays.drawn), rays.drawn
    local = np.zeros((rays.starts.shape[1], 6), np.float32)
    for axis, centre in enumerate(scene.centre.astype(np.float32)):
        np.divide(rays.starts[axis] - centre, np.float32(scene.scale), out=local[:, axis])
        local[:, 3 + axis] = rays.looking[axis]
    depth, kept, normals = scene.cast_kept(local)
    depth *= np.float32(scene.scale)
    for kind, lifted in rays.ahead.items():
        depth[parts[kind]] = np.maximum(depth[parts[kind]] + lifted, 0)
    codes = _normal_codes(scene, kept, normals, rays.looking)
    for kind, drew in drawn.items():
        if drew.normals is not None:
            codes[parts[kind]] = packing.encode_unit(drew.normals, np.int8)
    packed = {
        "positions": packing.interleaved(list(rays.positions), np.int16),
        "directions": packing.interleaved(rays.directions, np.int16),
        "depth": packing.encode_depth(depth),
        "normals": codes,
    }
    return Answers(drawn, packed, depth, kept, local[:, 3:])


def _probes(scene: raycast.Scene, answers: Answers) -> Probes:
    """The first samples of each type."""
    drawn, parts = answers.drawn, parts_of(answers.drawn)
    probes = np.concatenate([np.arange(part.start, part.stop)[:_ERROR_PROBE] for part in parts.values()])
    depth = answers.depth.take(probes)
    face = np.where(np.isfinite(depth), scene.kept.take(answers.kept.take(probes), mode="clip"), -1)
    normals = raycast.facing_back(scene, face, answers.looking[probes])
    for kind, drew in drawn.items():
        if drew.normals is not None:
            own = (probes >= parts[kind].start) & (probes < parts[kind].stop)
            normals[own] = drew.normals[:_ERROR_PROBE]
    positions, directions = (_joined(drawn, name, _ERROR_PROBE).T for name in ("positions", "directions"))
    first = draws.Draw(positions, directions)
    return Probes(first, {name: values.take(probes, axis=0) for name, values in answers.packed.items()}, depth, normals)


def _together(probes: Sequence[Probes]) -> Probes:
    """The probes of several casts, one after the other."""
    positions, directions = (
        np.concatenate([getattr(probe.drawn, name) for probe in probes]) for name in ("positions", "directions")
    )
    packed = {name: np.concatenate([probe.packed[name] for probe in probes]) for name in probes[0].packed}
    depth, normals = (np.concatenate([getattr(probe, name) for probe in probes]) for name in ("depth", "normals"))
    return Probes(draws.Draw(positions, directions), packed, depth, normals)


def _joined(drawn: dict[str, draws.Draw], name: str, count: int | None = None) -> Float[np.ndarray, "3 n"]:
    """Positions or directions of all types, of each the first `count`, one coordinate after the other."""
    return np.concatenate([getattr(drew, name)[:count].T for drew in drawn.values()], axis=1)


def _lift(
    size: float, drew: draws.Draw, starts: Float[np.ndarray, "3 n"], looking: list[np.ndarray]
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


def side_codes(normals: Float[np.ndarray, "m 3"]) -> Int[np.ndarray, "2 m 2"]:
    """Unit normals of triangles in stored form, and those of their other sides."""
    sides = normals.T.astype(np.float32)
    return packing.encode_unit(np.concatenate([sides, -sides], axis=1).T, np.int8).reshape(2, -1, 2)


def _normal_codes(
    scene: raycast.Scene,
    kept: UInt[np.ndarray, "n"],
    normals: Float[np.ndarray, "n 3"],
    looking: list[np.ndarray],
) -> Int[np.ndarray, "n 2"]:
    """Codes of `raycast.facing_back`, the axis (0, 0, 1) on a miss: each side of each triangle is coded once."""
    codes = np.concatenate([side_codes(scene.normals[scene.kept]).reshape(-1, 2), np.zeros((1, 2), np.int8)])
    slope = normals[:, 0] * looking[0]
    for axis in (1, 2):
        slope += normals[:, axis] * looking[axis]
    which = kept + (slope > 0) * np.uint32(len(scene.kept))  # on a miss the slope is 0
    return codes.view(np.int16)[:, 0].take(np.minimum(which, len(codes) - 1)).view(np.int8).reshape(-1, 2)


def packing_errors(probes: Sequence[Probes]) -> dict[str, float]:
    """Largest error of each stored type over all probes. Positions and directions: how far the stored (and cast) ray is
    from the drawn one; no error of the truth. Depth and normals: error of the truth itself.
    """
    whole = _together(probes)
    packed = {name: torch.from_numpy(whole.packed[name]) for name in packing.FIELDS}
    depth, hit = whole.depth, np.isfinite(whole.depth)
    stored_depth = packing.decode_depth(packed["depth"]).double().numpy()
    turned = _angle_deg(packing.decode_unit(packed["directions"]).double().numpy(), whole.drawn.directions)
    tilted = _angle_deg(packing.decode_unit(packed["normals"]).double().numpy()[hit], whole.normals[hit])
    moved = np.abs(packing.decode_positions(packed["positions"]).double().numpy() - whole.drawn.positions)
    return {
        "position_shift": float(moved.max(initial=0.0)),
        "direction_shift_deg": float(turned.max(initial=0.0)),
        "depth_error": float(np.abs(stored_depth[hit] - depth[hit]).max(initial=0.0)),
        "normal_error_deg": float(tilted.max(initial=0.0)),
    }


def _angle_deg(a: Float[np.ndarray, "n 3"], b: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
    """Between unit vectors that lie close together: their distance is the chord, 2 sin(angle / 2)."""
    apart = a - b
    return np.degrees(2 * np.arcsin(0.5 * np.sqrt(np.einsum("ij,ij->i", apart, apart))))
