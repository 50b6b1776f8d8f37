"""A network per camera: its derivative, closed-form normals of a ball from an exact one, and a trained one."""

import dataclasses

import pytest
import torch
from torch.nn import functional

from bench.lib import measuring
from bench.rivals import ray_fields, view_fields
from ddf.core import config
from ddf.fit import fit_settings
from ddf.geometry import primitives, rays

BALL, RADIUS = 0.6, 1.2
LAYOUT = view_fields.ViewLayout((16, 16), (8,), 2.0, 1.0)


def _views(cameras: int, each: int, spread: float = 0.55) -> tuple[torch.Tensor, torch.Tensor]:
    """Cameras all around a ball at 2.5 to 4, and rays towards it; float64."""
    random = torch.Generator().manual_seed(0)
    centres = functional.normalize(torch.randn(cameras, 3, generator=random).double(), dim=-1)
    centres = centres * (2.5 + 1.5 * torch.rand(cameras, 1, generator=random).double())
    aims = spread * (2 * torch.rand(cameras, each, 3, generator=random).double() - 1)
    return centres, functional.normalize(aims - centres[:, None], dim=-1)


def _field(seed: int = 0) -> view_fields.ViewField:
    torch.manual_seed(seed)
    return view_fields.ViewField(view_fields.WeightMaker(LAYOUT, RADIUS).double(), 100.0)


def test_slopes_are_those_of_autograd():
    o, v = _views(3, 40)
    weights = [(matrix.detach(), bias.detach()) for matrix, bias in _field().maker(o)]
    y = (0.5 * v).requires_grad_()
    raw, gradient = view_fields.slopes(weights, y)
    torch.testing.assert_close(view_fields.outputs(weights, y), raw)
    (truth,) = torch.autograd.grad(view_fields.chosen(raw).sum(), y)
    torch.testing.assert_close(gradient, truth)
    assert float(gradient.detach().norm(dim=-1).min()) > 0


def test_cameras_have_weights_of_their_own_that_follow_them_smoothly():
    field, (o, _) = _field(), _views(2, 1)
    with torch.no_grad():
        first, second = (
            torch.cat([part.flatten(1) for pair in field.maker(c) for part in pair], 1) for c in (o, o + 1e-6)
        )
    assert float((first[0] - first[1]).abs().max()) > 1e-3
    assert float((first - second).abs().max()) < 1e-4


def test_an_exact_network_gives_depth_and_normals_of_a_ball(monkeypatch):
    o, v = _views(5, 60, spread=0.3)
    field = _field()

    def exact(_, y):
        """Raw outputs whose softplus is the way from 1.5 R before the plane to the ball."""
        way = y - o[:, None]
        s = way.norm(dim=-1)
        along = functional.normalize(way, dim=-1)
        middle = (o[:, None] * along).sum(-1)
        depth = -middle - (middle.square() - o.square().sum(-1)[:, None] + BALL**2).sqrt()
        raw = (100 * (depth - s + view_fields.BEFORE * RADIUS)).expm1().log() / 100
        return torch.stack((raw, raw, torch.ones_like(raw), torch.ones_like(raw)), dim=-1)

    def slopes(weights, y):
        y = y.detach().requires_grad_()
        raw = exact(weights, y)
        return raw.detach(), torch.autograd.grad(raw[..., 0].sum(), y)[0]

    monkeypatch.setattr(view_fields, "outputs", exact)
    monkeypatch.setattr(view_fields, "slopes", slopes)
    points = rays.OrientedPoints(o[:, None].expand_as(v), v)
    truth = primitives.cast(primitives.Sphere(radius=BALL), points)
    clear = truth.visible & ((truth.normals * v).sum(-1) < -0.1)
    assert int(clear.sum()) > 150
    torch.testing.assert_close(field.depth(o, v)[clear], truth.depth[clear], rtol=0, atol=1e-8)
    torch.testing.assert_close(field.normals(o, v)[clear], truth.normals[clear], rtol=0, atol=1e-6)


@pytest.fixture(scope="module")
def _learnt() -> view_fields.ViewField:
    o, v = _views(200, 50)
    starts, along = o.repeat_interleave(50, dim=0), v.reshape(-1, 3)
    truth = primitives.cast(primitives.Sphere(radius=BALL), rays.OrientedPoints(starts, along))
    section = config.load(measuring.ROOT / "configs/fit.yaml", "fit", fit_settings.FitConfig)
    loop = dataclasses.replace(section.loop, threads=1, learning_rate=4e-3, muon=None)
    seen = ray_fields.SeenRays(starts.float(), along.float(), truth)
    return view_fields.fit(LAYOUT, seen, RADIUS, dataclasses.replace(section, loop=loop), 16, 16, 300)


def test_a_trained_one_learns_a_ball(_learnt):
    o, v = _views(20, 200)
    with torch.no_grad():
        depth = _learnt.depth(o.float(), v.float())
        normals = _learnt.normals(o.float(), v.float())
    truth = primitives.cast(primitives.Sphere(radius=BALL), rays.OrientedPoints(o[:, None].expand_as(v), v))
    both = torch.isfinite(depth) & truth.visible
    assert float((torch.isfinite(depth) != truth.visible).float().mean()) < 0.15
    assert float((depth - truth.depth)[both].abs().median()) < 0.05
    assert float((normals * truth.normals).sum(-1)[both].median()) > 0.95
