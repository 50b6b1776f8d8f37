"""Hard meshes, cast by Open3D and by brute force: no leaks, thin gaps, starts on faces, flat triangles, far away."""

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np
import torch

from ddf.data import mesh_topology, sampling
from ddf.data.samples import draws
from ddf.data.samples.surface import Surface
from ddf.geometry import mesh_io, raycast, rays, transforms

from . import case
from .ray_cases import DIRECTIONS, LATTICE

MESHES = case.Group("meshes")
CASTS: tuple[Callable[[mesh_io.Mesh, rays.OrientedPoints], rays.RayHits], ...] = (raycast.cast, raycast.cast_exact)
FAR = np.array([1e6, -1e6, 5e5])  # multiples of 1/4 around it are float32 numbers
TURN = torch.linalg.matrix_exp(
    torch.tensor([[0.0, 0.3, -0.7], [-0.3, 0.0, 0.4], [0.7, -0.4, 0.0]], dtype=torch.float64)
)


def _grid_box(lower: Sequence[float], upper: Sequence[float]) -> mesh_io.Mesh:
    """Twelve triangles of an axis-aligned box."""
    corners = np.array(list(itertools.product(*zip(lower, upper, strict=True))))
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return mesh_io.Mesh(corners, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))


CUBE = _grid_box((-1.0,) * 3, (1.0,) * 3)


def _square(height: float) -> mesh_io.Mesh:
    """[-1, 1]² at y = height."""
    corners = np.array([[-1.0, height, -1.0], [1.0, height, -1.0], [1.0, height, 1.0], [-1.0, height, 1.0]])
    return mesh_io.Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))


def _joined(*parts: mesh_io.Mesh) -> mesh_io.Mesh:
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    faces = [part.faces + offset for part, offset in zip(parts, offsets, strict=True)]
    return mesh_io.Mesh(np.concatenate([part.vertices for part in parts]), np.concatenate(faces))


def _points(positions: torch.Tensor, directions: torch.Tensor, dtype: torch.dtype) -> rays.OrientedPoints:
    return rays.OrientedPoints(positions.to(dtype), directions.to(dtype))


def _both(
    mesh: mesh_io.Mesh, points: rays.OrientedPoints, judge: Callable[[rays.RayHits], case.Outcome]
) -> case.Outcome:
    """The judgement of the fast cast and of the exact one."""
    return case.worst(*(judge(cast(mesh, points)) for cast in CASTS))


def _along(*directions: tuple[float, float, float]) -> torch.Tensor:
    return torch.tensor(directions, dtype=torch.float64)


@MESHES.case(
    "rays through edges and vertices",
    "from the centre of a turned cube to its corners and along its edges and face diagonals, and back from outside "
    "(390 rays)",
    "hits at the distance of the point aimed at: no leak",
)
def _no_leak(dtype: torch.dtype) -> case.Outcome:
    share = torch.linspace(0, 1, 10, dtype=torch.float64)[1:-1, None]
    corners = torch.from_numpy(CUBE.triangles)
    sides = [(1 - share) * a + share * b for c in corners for a, b in ((c[0], c[1]), (c[1], c[2]), (c[2], c[0]))]
    targets = torch.cat([corners.reshape(-1, 3), *sides]).unique(dim=0) @ TURN.T
    mesh = mesh_io.Mesh(CUBE.vertices @ TURN.numpy().T, CUBE.faces)
    length = targets.norm(dim=-1)
    outwards = targets / length[:, None]
    allowed = 40 * case.step(dtype)  # a direction's rounding times the distance, over the cosine of at worst 1/sqrt(3)
    inside = _both(
        mesh,
        _points(torch.zeros_like(targets), outwards, dtype),
        lambda hits: case.close(hits.depth, length, allowed),
    )
    outside = _both(
        mesh,
        _points(3 * outwards, -outwards, dtype),
        lambda hits: case.true("no leak", hits.visible),
    )
    return case.every(outside, inside)


@MESHES.case(
    "directions with exact zeros",
    "from the centre of the cube along the 26 directions of a lattice, through corners, edges and face diagonals",
    "hits at sqrt(3), sqrt(2) and 1",
)
def _zero_components(dtype: torch.dtype) -> case.Outcome:
    expected = LATTICE[LATTICE.square().sum(-1) > 0].norm(dim=-1)
    points = _points(torch.zeros_like(DIRECTIONS), DIRECTIONS, dtype)
    return _both(CUBE, points, lambda hits: case.close(hits.depth, expected, 4 * case.step(dtype)))


@MESHES.case(
    "grazing a flat mesh",
    "|n·v| = 1, 1e-1, ..., 1e-4: rays towards the middle of a square, from half a unit away along the ray",
    "a hit at 1/2, within 2 ε/|n·v|; at |n·v| <= 1e-3 within 1e-6 at best, because Open3D's float32 stands there",
)
def _grazing(dtype: torch.dtype) -> case.Outcome:
    found = []
    for slope in (1.0, 1e-1, 1e-2, 1e-3, 1e-4):
        direction = _along((math.sqrt(1 - slope * slope), -slope, 0.0)).to(dtype)
        start = (torch.tensor([[0.1, 0.0, 0.2]], dtype=torch.float64) - 0.5 * direction.double()).to(dtype)
        expected = start[:, 1].double() / -direction[:, 1].double()
        allowed = 2 * case.step(dtype) / slope if slope > 1e-3 else max(2 * case.step(dtype) / slope, 1e-6)
        points = rays.OrientedPoints(start, direction)
        found.append(_both(_square(0.0), points, lambda h, e=expected, a=allowed: case.close(h.depth, e, a)))
    return case.worst(*found)


@MESHES.case(
    "starts on a face",
    "starts on a face of the cube, away from edges, looking in and out",
    "t >= 0 counts: depth 0",
)
def _on_face(dtype: torch.dtype) -> case.Outcome:
    start = torch.tensor([[1.0, 0.25, 0.5]] * 2, dtype=torch.float64)
    points = _points(start, _along((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)), dtype)
    return _both(CUBE, points, lambda hits: case.exact(hits.depth, [0.0, 0.0]))


@MESHES.case(
    "starts 1e-7 off a face",
    "x = 1 ± 1e-7 beside a face of the cube, looking in and out",
    "the gap, the rest of the way to the far side, or a miss",
)
def _beside_face(dtype: torch.dtype) -> case.Outcome:
    x = torch.tensor([1 + 1e-7, 1 + 1e-7, 1 - 1e-7, 1 - 1e-7], dtype=torch.float64).to(dtype).double()
    start = torch.stack((x, torch.full_like(x, 0.25), torch.full_like(x, 0.5)), dim=-1)
    looking = _along((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)).repeat(2, 1)
    expected = torch.tensor([math.inf, x[1] - 1, 1 - x[2], 1 + x[3]])
    return _both(CUBE, _points(start, looking, dtype), lambda hits: case.close(hits.depth, expected, 1e-12))


def _beside_slanted_face(
    gap: float, dtype: torch.dtype, cast: Callable[[mesh_io.Mesh, rays.OrientedPoints], rays.RayHits]
) -> case.Outcome:
    """200 starts on both sides of a face of the turned cube, looking at it; truth: the gap of the start as rounded."""
    generator = torch.Generator().manual_seed(0)
    flat = 1.8 * torch.rand(200, 3, generator=generator, dtype=torch.float64) - 0.9
    side = torch.where(torch.arange(200) % 2 == 0, 1.0, -1.0).double()
    flat[:, 0] = 1 + gap * side
    normal = TURN[:, 0]
    start, looking = (flat @ TURN.T).to(dtype), (-side[:, None] * normal).to(dtype)
    left = side * (start.double() @ normal - 1)
    near = left > 0.1 * gap  # rounding to the type moves some starts onto the face or through it
    mesh = mesh_io.Mesh(CUBE.vertices @ TURN.numpy().T, CUBE.faces)
    return case.close(cast(mesh, rays.OrientedPoints(start[near], looking[near])).depth, left[near], 1e-12)


@MESHES.case(
    "starts 1e-5 off a slanted face",
    "200 starts 1e-5 outside and inside a face of a turned cube, looking at the face",
    "the gap, exact to 1e-12",
)
def _off_slanted_face(dtype: torch.dtype) -> case.Outcome:
    return case.worst(*(_beside_slanted_face(1e-5, dtype, cast) for cast in CASTS))


@MESHES.case(
    "starts 1e-7 off a slanted face, by brute force",
    "as above, 1e-7 off: less than the rounding of a float32 coordinate",
    "the gap, exact to 1e-12",
)
def _off_slanted_face_exact(dtype: torch.dtype) -> case.Outcome:
    return _beside_slanted_face(1e-7, dtype, raycast.cast_exact)


@MESHES.case(
    "starts 1e-7 off a slanted face, by Open3D",
    "as above",
    "the gap, exact to 1e-12",
)
def _off_slanted_face_fast(dtype: torch.dtype) -> case.Outcome:
    return _beside_slanted_face(1e-7, dtype, raycast.cast)


@MESHES.case(
    "two sheets 1e-5 apart",
    "squares at y = 0 and y = -1e-5; rays from above, from below, and from the middle of the gap both ways",
    "the near sheet each time: 1, 1, 5e-6, 5e-6",
)
def _thin_gap(dtype: torch.dtype) -> case.Outcome:
    start = torch.tensor([[0.1, y, 0.2] for y in (1.0, -1.0 - 1e-5, -5e-6, -5e-6)], dtype=torch.float64)
    looking = _along((0.0, -1.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0))
    points = _points(start, looking, dtype)
    y = points.positions[:, 1].double()
    expected = torch.stack((y[0], -1e-5 - y[1], -y[2], y[3] + 1e-5))
    return _both(_joined(_square(0.0), _square(-1e-5)), points, lambda hits: case.close(hits.depth, expected, 1e-12))


@MESHES.case(
    "degenerate triangles",
    "a repeated vertex, a repeated corner and three corners on a line, before and beside a cube",
    "never hit: the cube behind is, and nothing where there is none",
)
def _degenerate(dtype: torch.dtype) -> case.Outcome:
    flat = mesh_io.Mesh(
        np.array([[-2.0, 0, -3], [-2, 0, 3], [-2, 0, 0], [-2, 0, 0]]), np.array([[0, 1, 2], [0, 0, 1], [2, 3, 1]])
    )
    start = torch.tensor([[-4.0, 0.0, 0.0], [-4.0, 0.0, 2.0]])
    points = _points(start, _along((1.0, 0.0, 0.0), (1.0, 0.0, 0.0)), dtype)
    return _both(_joined(flat, CUBE), points, lambda hits: case.exact(hits.depth, [3.0, math.inf]))


@MESHES.case(
    "nothing but degenerate triangles",
    "three triangles without an area: cast, cleaned, sampled, normalised (all vertices at one place)",
    "misses; refused by the others",
)
def _all_degenerate(dtype: torch.dtype) -> case.Outcome:
    flat = mesh_io.Mesh(np.zeros((3, 3)), np.array([[0, 1, 2], [0, 0, 1], [1, 1, 1]]))
    points = _points(torch.zeros(1, 3) - 1, _along((1.0, 0.0, 0.0)), dtype)
    return case.every(
        _both(flat, points, lambda hits: case.exact(hits.depth, [math.inf])),
        case.refused(lambda: mesh_topology.clean(flat), "no triangle has an area"),
        case.refused(lambda: Surface.of(flat).draw(1, np.random.default_rng(0)), "must have a triangle with an"),
        case.refused(lambda: transforms.field_from_mesh(flat.vertices), "vertices must span a box"),
    )


@MESHES.case("no triangles, no rays", "a mesh without triangles; a cube and no rays", "misses; arrays of length 0")
def _empty(dtype: torch.dtype) -> case.Outcome:
    nothing = mesh_io.Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
    one = _points(torch.zeros(1, 3), _along((0.0, 1.0, 0.0)), dtype)
    none = _points(torch.zeros(0, 3), torch.zeros(0, 3), dtype)
    return case.every(
        _both(nothing, one, lambda hits: case.exact(hits.depth, [math.inf])),
        _both(CUBE, none, lambda hits: case.exact(hits.depth, torch.zeros(0))),
    )


@MESHES.case(
    "meshes that are not meshes",
    "a NaN coordinate; a triangle that asks for vertex 8 of 8, or -1",
    "refused, naming the rule",
)
def _refused(dtype: torch.dtype) -> case.Outcome:
    del dtype  # meshes are float64
    broken = CUBE.vertices.copy()
    broken[5, 1] = np.nan
    return case.worst(
        case.refused(lambda: mesh_io.Mesh(broken, CUBE.faces), r"vertices must be finite; got nan at index \(5, 1\)"),
        case.refused(lambda: mesh_io.Mesh(CUBE.vertices, np.array([[0, 1, -1]])), "faces must index .*; got index -1"),
        case.refused(lambda: mesh_io.Mesh(CUBE.vertices, np.array([[0, 1, 8]])), "faces must index .*; got index 8"),
    )


@MESHES.case(
    "a mesh 1e6 from its origin",
    "the cube around (1e6, -1e6, 5e5), starts inside and outside on multiples of 1/4",
    "the depths of the cube at its origin, exactly",
)
def _far_mesh(dtype: torch.dtype) -> case.Outcome:
    mesh = mesh_io.Mesh(CUBE.vertices + FAR, CUBE.faces)
    start = torch.tensor([[0.5, 0.25, 0.0], [-2.0, 0.25, 0.5], [0.25, 3.0, 0.25], [-2.0, 1.25, 0.0]])
    looking = _along((1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0))
    points = _points(start + torch.from_numpy(FAR), looking, dtype)
    return _both(mesh, points, lambda hits: case.close(hits.depth, [0.5, 1.0, 2.0, math.inf], 1e-9))


@MESHES.case(
    "normalising a mesh 1e6 from its origin",
    "the box [-1, 1] x [-1/2, 1/2] x [-1/4, 1/4] around (1e6, -1e6, 5e5), coordinates of the type",
    "the field's box is exactly the same around 0, longest side 2; there and back within 1e-9",
)
def _far_normalised(dtype: torch.dtype) -> case.Outcome:
    here = _grid_box((-1.0, -0.5, -0.25), (1.0, 0.5, 0.25)).vertices
    there = torch.from_numpy(here + FAR).to(dtype).double().numpy()
    frame = transforms.field_from_mesh(there)
    return case.worst(
        case.exact(frame.apply(there), here), case.close(frame.inverse().apply(frame.apply(there)), there, 1e-9)
    )


@MESHES.case(
    "cameras 1e5 units away",
    "100 rays from 1e5 away to points of the cube's face x = -1; the triangle found in float32",
    "depth 1e5 to float64's rounding times 1e5 (float32: to that of the start)",
)
def _far_camera(dtype: torch.dtype) -> case.Outcome:
    generator = torch.Generator().manual_seed(1)
    target = 1.8 * torch.rand(100, 3, generator=generator, dtype=torch.float64) - 0.9
    target[:, 0] = -1.0
    start = target - torch.tensor([1e5, 0.0, 0.0], dtype=torch.float64)
    points = _points(start, _along((1.0, 0.0, 0.0)).expand(100, 3), dtype)
    expected = -1 - points.positions[:, 0].double()
    return _both(CUBE, points, lambda hits: case.close(hits.depth, expected, 1e-9))


@MESHES.case(
    "sizes 1e-6 and 1e6",
    "the cube scaled by 1e-6 and by 1e6, rays from its centre to corners, edges and faces",
    "the same depths, scaled",
)
def _sizes(dtype: torch.dtype) -> case.Outcome:
    expected = LATTICE[LATTICE.square().sum(-1) > 0].norm(dim=-1)
    points = _points(torch.zeros_like(DIRECTIONS), DIRECTIONS, dtype)
    found = []
    for size in (1e-6, 1e6):
        mesh = mesh_io.Mesh(size * CUBE.vertices, CUBE.faces)
        found.append(_both(mesh, points, lambda h, s=size: case.close(h.depth / s, expected, 4 * case.step(dtype))))
    return case.worst(*found)


@MESHES.case(
    "areas of a sampled soup",
    "a cube and 1,000 triangles without an area among its own, 4,000 points by area",
    "none on a triangle without an area, all on the cube",
)
def _sampled(dtype: torch.dtype) -> case.Outcome:
    flat = mesh_io.Mesh(np.repeat([[5.0, 5.0, 5.0]], 3, axis=0), np.zeros((500, 3), dtype=np.int64))
    soup = _joined(flat, CUBE, flat)
    points, face = Surface.of(soup).draw(4000, np.random.default_rng(0))
    on_cube = torch.from_numpy(points).to(dtype).abs().amax(-1)
    return case.every(
        case.true("none on a flat one", (face >= 500) & (face < 512)),
        case.close(on_cube, torch.ones(4000), case.step(dtype)),
    )


@MESHES.case(
    "offset lines beside the wall of the box",
    "2,000 samples of type O, ε = 0.05, of the cube that fills its box: half of the lines would leave it",
    "all positions in the box, all lines 0.05 inside the face that they are offset from",
)
def _offset(dtype: torch.dtype) -> case.Outcome:
    surface = sampling.surface_of(raycast.Scene(CUBE))
    drawn = draws.draw_offset(draws.Place(surface, draws.CUBE, 0.05), 2000, np.random.default_rng(0))
    depth = torch.from_numpy(drawn.positions).to(dtype).abs()
    off = (depth - 0.95).abs().amin(-1)
    return case.every(
        case.true("all in the box", depth.amax(-1) <= 1),
        case.close(off, torch.zeros(2000), 2 * case.step(torch.float32)),
    )
