"""Hard rays: grazing, on the surface, along the axes, from far away, refused. Truth: spheres, planes, tori, boxes."""

import itertools
import math

import _closed_form
import torch
from torch import Tensor
from torch.nn import functional

from ddf.geometry import primitives, rays

from . import case

RAYS = case.Group("rays")
SLOPES = (1.0, 1e-1, 1e-2, 1e-3, 1e-4)  # |n·v|
LATTICE = torch.tensor(list(itertools.product((-1.0, 0.0, 1.0), repeat=3)), dtype=torch.float64)
DIRECTIONS = functional.normalize(LATTICE[LATTICE.square().sum(-1) > 0], dim=-1)


def lattice_rays(dtype: torch.dtype) -> tuple[Tensor, Tensor]:
    """Corners, edge and face middles and the centre of [-1, 1]³, each with 26 directions, zeros of both signs."""
    both = torch.cat((DIRECTIONS, torch.where(DIRECTIONS == 0, -0.0, DIRECTIONS))).to(dtype)
    return LATTICE.to(dtype).repeat_interleave(len(both), dim=0), both.repeat(len(LATTICE), 1)


def _cast(shape: primitives.Primitive, positions: Tensor, directions: Tensor) -> rays.RayHits:
    return primitives.cast(shape, rays.OrientedPoints(positions, directions))


def _along_x(starts: list[tuple[float, float, float]], dtype: torch.dtype) -> tuple[Tensor, Tensor]:
    positions = torch.tensor(starts, dtype=torch.float64).to(dtype)
    return positions, torch.tensor([1.0, 0.0, 0.0], dtype=dtype).expand_as(positions)


def _sine(cosine: Tensor) -> Tensor:
    """sqrt(1 - y²) without cancellation, float64."""
    return torch.sqrt((1 - cosine.double()) * (1 + cosine.double()))


@RAYS.case(
    "grazing a sphere",
    "|n·v| = 1, 1e-1, 1e-2, 1e-3, 1e-4 (0 in float32): starts (-2, sqrt(1 - |n·v|²), 0), direction x, radius 1",
    "a hit at 2 - |n·v|, within 2 ε/|n·v| and sqrt(2 ε), what the rounding of a start changes",
)
def _grazing_sphere(dtype: torch.dtype) -> case.Outcome:
    positions, directions = _along_x([(-2.0, math.sqrt(1 - s * s), 0.0) for s in SLOPES], dtype)
    slope = _sine(positions[:, 1])
    hits = _cast(primitives.Sphere(), positions, directions)
    facing = (hits.normals * directions).sum(-1)
    allowed = (2 * case.step(dtype) / slope).clamp_max(math.sqrt(2 * case.step(dtype)))
    return case.worst(case.close(facing, -slope, allowed), case.close(hits.depth, 2 - slope, allowed))


@RAYS.case(
    "grazing a plane",
    "|n·v| = 1, 1e-1, ..., 1e-4: starts two units before a plane through the origin",
    "a hit at 2, the normal facing back",
)
def _grazing_plane(dtype: torch.dtype) -> case.Outcome:
    found = []
    for slope in SLOPES:
        positions, directions = _along_x([(-2.0, 0.0, 0.0)], dtype)
        for sign in (-1.0, 1.0):
            plane = _closed_form.Plane((sign * slope, math.sqrt(1 - slope * slope), 0.0))
            hits = _cast(plane, positions, directions)
            found.append(case.close((hits.normals * directions).sum(-1), [-slope], 2 * case.step(dtype) * slope))
            found.append(case.close(hits.depth, [2.0], 4 * case.step(dtype)))
    return case.worst(*found)


@RAYS.case(
    "grazing a torus",
    "|n·v| = 1, 1e-1, ..., 1e-4 (0 in float32) on the tube of radius 1/4 around the circle of radius 3/4, roots of a "
    "quartic; starts in the type, roots in float64",
    "a hit at 5/4 - |n·v|/4, within 1e-7: a double root of a quartic is known to sqrt(ε)",
)
def _grazing_torus(dtype: torch.dtype) -> case.Outcome:
    positions, directions = _along_x([(-2.0, 0.25 * math.sqrt(1 - s * s), 0.0) for s in SLOPES], dtype)
    positions, directions = positions.double(), directions.double()
    half = _sine(4 * positions[:, 1]) / 4
    return case.close(_cast(_closed_form.Torus(0.75, 0.25), positions, directions).depth, 1.25 - half, 1e-7)


@RAYS.case(
    "touching a sphere, |n·v| = 0",
    "starts (-2, y, 0), direction x, radius 1: y = 1, and the next number above 1",
    "a hit at 2; a miss",
)
def _touching_sphere(dtype: torch.dtype) -> case.Outcome:
    positions, directions = _along_x([(-2.0, 1.0, 0.0), (-2.0, 1.0 + case.step(dtype), 0.0)], dtype)
    hits = _cast(primitives.Sphere(), positions, directions)
    return case.exact(hits.depth, [2.0, math.inf])


@RAYS.case(
    "in a plane and beside it",
    "starts in the plane y = 0 and 1e-7 above it, directions parallel to it",
    "misses: a plane seen edge-on has no first point",
)
def _in_plane(dtype: torch.dtype) -> case.Outcome:
    positions, directions = _along_x([(0.0, 0.0, 0.0), (0.0, 1e-7, 0.0), (0.0, -1e-7, 0.0)], dtype)
    hits = _cast(_closed_form.Plane(), positions, directions)
    return case.every(case.exact(hits.depth, [math.inf] * 3), case.exact(hits.normals, torch.zeros(3, 3)))


@RAYS.case(
    "starts on a sphere and 1e-7 off it",
    "x = 1, 1 + 1e-7, 1 - 1e-7 on the axis of the unit sphere, looking away and back",
    "t >= 0 counts: 0 on it; beside it the gap to the near side, the rest of the diameter, or a miss",
)
def _on_sphere(dtype: torch.dtype) -> case.Outcome:
    x = torch.tensor([1.0, 1.0 + 1e-7, 1.0 - 1e-7], dtype=torch.float64).to(dtype)
    zero = torch.zeros_like(x)
    positions = torch.stack((x, zero, zero), dim=-1).repeat(2, 1)
    directions = torch.tensor([1.0, 0.0, 0.0], dtype=dtype).expand(3, 3)
    hits = _cast(primitives.Sphere(), positions, torch.cat((directions, -directions)))
    x = x.double()
    away, back = [0.0, math.inf, 1 - x[2]], [0.0, x[1] - 1, 1 + x[2]]
    return case.close(hits.depth, torch.tensor([*away, *back]), 2 * case.step(dtype))


@RAYS.case(
    "from the centre through corners and edges of a box",
    "the cube [-1, 1]³, directions to its 8 corners, 12 edges and 6 faces, zeros of both signs",
    "hits at sqrt(3), sqrt(2) and 1: no leak",
)
def _box_lattice(dtype: torch.dtype) -> case.Outcome:
    targets = LATTICE[LATTICE.square().sum(-1) > 0]
    expected = targets.norm(dim=-1).repeat(2)
    directions = lattice_rays(dtype)[1][: len(expected)]
    hits = _cast(primitives.Box(), torch.zeros_like(directions), directions)
    return case.close(hits.depth, expected, 4 * case.step(dtype))


@RAYS.case(
    "box entry from its boundary",
    "starts on corners, edges, faces and at the centre of [-1, 1]³, 52 directions each, exact zeros of both signs",
    "in the box already: distance exactly 0, entry = start",
)
def _entry_on_boundary(dtype: torch.dtype) -> case.Outcome:
    positions, directions = lattice_rays(dtype)
    one = torch.ones(3, dtype=dtype)
    entry, distance, meets = rays.enter_box(positions, directions, -one, one)
    return case.every(
        case.true("all meet it", meets), case.exact(distance, torch.zeros(len(positions))), case.exact(entry, positions)
    )


@RAYS.case(
    "box entry along the axes",
    "starts 4 before the box, two components of v exactly 0 or -0, beside the box by 0, by ε and inside by ε",
    "distance exactly 4 inside and on the slab, a miss ε outside it",
)
def _entry_along_axes(dtype: torch.dtype) -> case.Outcome:
    one, found = torch.ones(3, dtype=dtype), []
    beside = torch.tensor([1.0, 1.0 + case.step(dtype), 1.0 - case.step(dtype)], dtype=dtype)
    for axis, sign, zero in itertools.product(range(3), (-1.0, 1.0), (0.0, -0.0)):
        direction = torch.full((3,), zero, dtype=dtype)
        direction[axis] = sign
        start = beside[:, None].repeat(1, 3)
        start[:, axis] = -5.0 * sign
        _, distance, meets = rays.enter_box(start, direction.expand(3, 3), -one, one)
        found += [case.exact(meets, [1, 0, 1]), case.exact(distance, [4.0, 0.0, 4.0])]
    return case.worst(*found)


@RAYS.case(
    "starts 1e3 box lengths away",
    "1,000 rays from 2,000 units to points of the box's face x = -1",
    "distance 2,000 within 4,000 ε, entry at the point within as much, never outside the box by a bit",
)
def _far_starts(dtype: torch.dtype) -> case.Outcome:
    generator = torch.Generator().manual_seed(0)
    target = 1.8 * torch.rand(1000, 3, generator=generator, dtype=torch.float64) - 0.9
    target[:, 0] = -1.0
    direction = torch.randn(1000, 3, generator=generator, dtype=torch.float64)
    direction[:, 0] = direction.norm(dim=-1)  # at least 45 degrees to the face, so that the face is what it enters by
    direction = functional.normalize(direction, dim=-1)
    start, one = (target - 2000 * direction).to(dtype), torch.ones(3, dtype=dtype)
    entry, distance, meets = rays.enter_box(start, direction.to(dtype), -one, one)
    allowed = 4000 * case.step(dtype)
    return case.every(
        case.true("all meet it", meets),
        case.true("none outside", (entry.abs() <= 1).all(-1)),
        case.worst(case.close(distance, torch.full((1000,), 2000.0), allowed), case.close(entry, target, allowed)),
    )


@RAYS.case(
    "numbers of float16's range",
    "starts at ±65504 (its largest number) and ±6e-8 (its smallest) on an axis, towards the unit sphere",
    "hits at 65503 and at 1 less or more than the start, exactly what the type can hold",
)
def _float16_range(dtype: torch.dtype) -> case.Outcome:
    ends = torch.tensor([65504.0, -65504.0, 2.0**-24, -(2.0**-24)], dtype=torch.float16).to(dtype)
    zero = torch.zeros_like(ends)
    directions = torch.stack((-ends.sign(), zero, zero), dim=-1)
    hits = _cast(primitives.Sphere(), torch.stack((ends, zero, zero), dim=-1), directions)
    inside = 1 + 2.0**-24
    return case.close(hits.depth, [65503.0, 65503.0, inside, inside], case.step(dtype) / 2)


@RAYS.case(
    "directions that are not unit",
    "lengths 0, 0.9998, 1.0002, 2; and (1, 1, 1)/sqrt(3) rounded to float16 (length 0.99964)",
    "refused, naming rule, length and index",
)
def _not_unit(dtype: torch.dtype) -> case.Outcome:
    found = []
    for length, told in ((0.0, "0"), (0.9998, "0.9998"), (1.0002, "1.0002"), (2.0, "2")):
        direction = torch.tensor([[0.6 * length, 0.8 * length, 0.0]], dtype=dtype)
        rule = rf"directions must be unit length \(tol 0\.0001\); got {told} at index \(0,\)"
        found.append(case.refused(lambda d=direction: rays.OrientedPoints(torch.zeros_like(d), d), rule))
    rounded = torch.full((1, 3), 3**-0.5, dtype=torch.float16).to(dtype)
    rule = "must be unit length .* got 0.99965"
    return case.worst(*found, case.refused(lambda: rays.OrientedPoints(torch.zeros_like(rounded), rounded), rule))


@RAYS.case(
    "directions that rounding made unit but for 1e-5",
    "lengths 1 - 1e-5 and 1 + 1e-5",
    "accepted as they are",
)
def _nearly_unit(dtype: torch.dtype) -> case.Outcome:
    directions = torch.tensor([[1 - 1e-5, 0.0, 0.0], [0.0, 0.0, 1 + 1e-5]], dtype=dtype)
    return case.exact(rays.OrientedPoints(torch.zeros_like(directions), directions).directions, directions)


@RAYS.case(
    "values that are not finite",
    "NaN and ±inf in positions and in directions",
    "refused, naming the array",
)
def _not_finite(dtype: torch.dtype) -> case.Outcome:
    good, found = torch.tensor([[0.0, 1.0, 0.0]], dtype=dtype), []
    for value in (math.nan, math.inf, -math.inf):
        bad = good.clone()
        bad[0, 2] = value
        told = rf"positions must be finite; got {value} at index \(0, 2\)"
        found.append(case.refused(lambda b=bad: rays.OrientedPoints(b, good), told))
        found.append(case.refused(lambda b=bad: rays.OrientedPoints(good, b), "directions must be unit length"))
    return case.worst(*found)


@RAYS.case("no rays", "arrays of shape (0, 3)", "arrays of length 0")
def _none(dtype: torch.dtype) -> case.Outcome:
    nothing, one = torch.zeros(0, 3, dtype=dtype), torch.ones(3, dtype=dtype)
    hits = _cast(primitives.Sphere(), nothing, nothing)
    entry, distance, meets = rays.enter_box(nothing, nothing, -one, one)
    shapes = [tuple(t.shape) for t in (hits.depth, hits.normals, entry, distance, meets)]
    return case.Outcome(f"shapes {shapes}", shapes == [(0,), (0, 3), (0, 3), (0,), (0,)])
