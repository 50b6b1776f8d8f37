"""Closed-form DDFs: against a search along the ray, and against the identities of exact fields."""

import pytest
import torch
from _shapes import random_rays
from _support import assert_close

from ddf.geometry import primitives, rays

NESTED = primitives.Union((primitives.Sphere(radius=0.9), primitives.Sphere(radius=0.4)))
SHAPES = {
    "sphere": primitives.Sphere((0.1, -0.2, 0.05), 0.8),
    "box": primitives.Box((-0.9, -0.5, -0.7), (0.8, 0.6, 0.4)),
    "nested": NESTED,
    "pair": primitives.two_spheres(),
}


def _signed(shape: primitives.Primitive, x: torch.Tensor) -> list[torch.Tensor]:
    """One function per sheet that changes its sign there."""
    if isinstance(shape, primitives.Sphere):
        return [(x - x.new_tensor(shape.centre)).norm(dim=-1) - shape.radius]
    if isinstance(shape, primitives.Box):
        lower, upper = x.new_tensor(shape.lower), x.new_tensor(shape.upper)
        return [torch.maximum(lower - x, x - upper).amax(-1)]
    assert isinstance(shape, primitives.Union)
    return [value for part in shape.parts for value in _signed(part, x)]


def _marched_depth(shape: primitives.Primitive, points: rays.OrientedPoints) -> torch.Tensor:
    """First change of sign on a fine walk along each ray, then bisection."""
    t = torch.linspace(0, 6, 3001, dtype=torch.float64)
    best = torch.full((len(points.positions),), torch.inf, dtype=torch.float64)
    walk = points.positions[:, None] + t[:, None] * points.directions[:, None]
    for sheet, values in enumerate(_signed(shape, walk)):
        change = values[:, 1:].sign() != values[:, :-1].sign()
        rows = change.any(dim=1).nonzero()[:, 0]
        low = t[change[rows].float().argmax(dim=1)]
        high = low + (t[1] - t[0])
        for _ in range(60):
            middle = (low + high) / 2
            at = lambda s, rows=rows: points.positions[rows] + s[:, None] * points.directions[rows]  # noqa: E731
            same = _signed(shape, at(low))[sheet].sign() == _signed(shape, at(middle))[sheet].sign()
            low, high = torch.where(same, middle, low), torch.where(same, high, middle)
        best[rows] = torch.minimum(best[rows], low)
    return best


@pytest.mark.parametrize("name", SHAPES)
def test_depth_equals_march_along_ray(name):
    points = random_rays(400, seed=1)
    hits, marched = primitives.cast(SHAPES[name], points), _marched_depth(SHAPES[name], points)
    short = hits.depth <= 5.99  # the walk ends at 6
    slope = (hits.normals * points.directions).sum(-1).abs()
    clear = torch.where(hits.visible, slope > 0.1, True)  # a grazing pair of roots can fall between two steps
    agree = clear & (short | ~hits.visible)
    assert agree.sum() > 300 and (hits.visible & agree).sum() > 40
    missed = agree & (marched.isfinite() != hits.visible)
    assert missed.sum() == 0
    assert_close(hits.depth[agree], marched[agree], atol=1e-9, rtol=0)


def _clear_rays(name: str, seed: int) -> rays.OrientedPoints:
    points = random_rays(400, seed=seed)
    hits = primitives.cast(SHAPES[name], points)
    keep = hits.visible & ((hits.normals * points.directions).sum(-1) < -0.2)
    if name == "box":  # away from edges, where the normal jumps
        q = points.positions[keep] + hits.depth[keep, None] * points.directions[keep]
        box = SHAPES["box"]
        gaps = torch.stack([(q - q.new_tensor(box.lower)).abs(), (q - q.new_tensor(box.upper)).abs()]).amin(0)
        inner = gaps.sort(dim=-1).values[:, 1] > 0.02
        keep = keep.nonzero()[inner, 0]
    return rays.OrientedPoints(points.positions[keep], points.directions[keep])


def _depth(name: str, positions: torch.Tensor, directions: torch.Tensor) -> torch.Tensor:
    return SHAPES[name].first(positions, directions)[0]


@pytest.mark.parametrize("name", SHAPES)
def test_depth_obeys_properties_i_to_iii(name):
    points = _clear_rays(name, seed=3)
    p, v = points.positions.clone().requires_grad_(), points.directions.clone().requires_grad_()
    depth = _depth(name, p, v)
    grad_p, grad_v = torch.autograd.grad(depth.sum(), (p, v))
    normals = primitives.cast(SHAPES[name], points).normals
    slope = (normals * points.directions).sum(-1, keepdim=True)
    assert len(depth) > 20
    assert_close((grad_p * points.directions).sum(-1), -torch.ones(len(depth), dtype=torch.float64), atol=1e-8)
    assert_close(grad_p, -normals / slope, atol=1e-7, rtol=1e-7)
    assert_close(grad_p.norm(dim=-1), 1 / slope[:, 0].abs(), atol=1e-7, rtol=1e-7)
    random = torch.randn(len(depth), 3, dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    turn = torch.linalg.cross(random, points.directions)
    left = (grad_v * turn).sum(-1)
    assert_close(left, depth.detach() * (grad_p * turn).sum(-1), atol=1e-7, rtol=1e-7)


@pytest.mark.parametrize("name", SHAPES)
def test_curvatures_equal_property_v(name):
    points = _clear_rays(name, seed=5)
    points = rays.OrientedPoints(points.positions[:40], points.directions[:40])
    hits, expected = primitives.cast(SHAPES[name], points), primitives.curvatures(SHAPES[name], points)
    p = points.positions.clone().requires_grad_()
    (grad_p,) = torch.autograd.grad(_depth(name, p, points.directions).sum(), p, create_graph=True)
    grad_p = grad_p + 0 * p  # flat shapes: a graph that is zero, not absent
    second = torch.stack([torch.autograd.grad(grad_p[:, i].sum(), p, retain_graph=True)[0] for i in range(3)], dim=1)
    along = (second @ points.directions[..., None])[..., 0]
    assert_close(along, torch.zeros_like(along), atol=1e-6)  # Property I, differentiated once more
    frame = torch.linalg.svd(hits.normals[:, None]).Vh[:, 1:]
    slope = (hits.normals * points.directions).sum(-1)
    form = slope[:, None, None] * frame @ second @ frame.mT
    assert_close(torch.linalg.eigvalsh(form), expected.sort(dim=-1).values, atol=1e-6, rtol=1e-6)
