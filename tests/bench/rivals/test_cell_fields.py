"""Many small networks: each ray by its own, smooth across borders of cells; a trained one."""

import dataclasses

import numpy as np
import pytest
import torch
from torch.nn import functional

from bench.lib import measuring
from bench.rivals import cell_fields, cells, ray_fields
from ddf.core import config
from ddf.fields import derivatives, pddf
from ddf.fit import fit_settings
from ddf.geometry import primitives, rays

BALL, SIDE = 0.6, 0.7
UPPER = (SIDE, SIDE, SIDE)
LAYOUT = cells.CellLayout(2, 2, 0.05, 0.1)


def _lines(count: int, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    """From outside, towards points of a smaller box; float64."""
    random = torch.Generator().manual_seed(seed)
    v = functional.normalize(torch.randn(count, 3, generator=random).double(), dim=-1)
    aims = 0.5 * (2 * torch.rand(count, 3, generator=random).double() - 1)
    return aims - 2.5 * v, v


def _field(visible: float = 5.0) -> cell_fields.CellField:
    """As made, but that every network sees something; float64."""
    torch.manual_seed(0)
    networks = cell_fields.CellNetworks(6 * LAYOUT.cells, (8, 8), 1.0).double().requires_grad_(False)
    networks.matrices[-1][..., pddf.VISIBILITY_ROW] = 0
    networks.shifts[-1][..., pddf.VISIBILITY_ROW] = visible
    networks.matrices[-1][..., pddf.WEIGHT_ROW] = 0  # one component, which has no jumps
    return cell_fields.CellField(networks, torch.arange(6 * LAYOUT.cells), LAYOUT, UPPER)


def _seen(count: int, seed: int = 0) -> ray_fields.SeenRays:
    p, v = _lines(count, seed)
    return ray_fields.SeenRays(
        p.float(), v.float(), primitives.cast(primitives.Sphere(radius=BALL), rays.OrientedPoints(p, v))
    )


@pytest.mark.parametrize("count", [1, 7, 1_000])
def test_outputs_are_those_of_a_plain_loop(count):
    """Of several networks, empty ones among them, and rays that no network knows."""
    networks, random = _field().networks, torch.Generator().manual_seed(1)
    local = torch.randn(4, count, generator=random).double()
    who = torch.randint(-1, 9, (count,), generator=random)
    with torch.no_grad():
        found = cell_fields.outputs(networks, who, local)
    for row, name in enumerate(who.tolist()):
        hidden = local[:, row]
        for layer, (matrix, shift) in enumerate(zip(networks.matrices, networks.shifts, strict=True)):
            hidden = hidden @ matrix[name] + shift[name, 0]
            hidden = hidden.sin() if layer < 2 else hidden
        truth = hidden if name >= 0 else torch.tensor(cell_fields.NOTHING).double()
        torch.testing.assert_close(found[row], truth)


def test_depth_and_derivative_are_continuous_across_borders():
    """On a path of starts through many cells, and on one of directions."""
    field, count = _field(), 8_001
    t = torch.linspace(0, 1, count).double()[:, None]
    for starts, ways in (
        (torch.tensor([[-2.0, -0.9, -0.8]]) + t * torch.tensor([[0.0, 1.8, 1.6]]), torch.tensor([[1.0, -0.2, 0.3]])),
        (torch.tensor([[-2.0, -0.3, -0.2]]), torch.tensor([[1.0, -0.4, 0.05]]) + t * torch.tensor([[-0.3, 1.4, 0.6]])),
    ):
        p, v = (part.double().expand(count, 3) for part in (starts, functional.normalize(ways.double(), dim=-1)))
        assert len(torch.unique(cells.pairs(p, v, LAYOUT, UPPER).cells)) > 2
        depth, p = field.depth(p, v), p.clone().requires_grad_()
        (gradient,) = torch.autograd.grad(field.depth(p, v).sum(), p)
        for values in (depth[:, None], gradient):
            steps = values.diff(dim=0).abs().amax(-1)
            coarse = values[::2].diff(dim=0).abs().amax(-1)
            assert float(steps.max()) > 0 and float(coarse.max() / steps.max()) == pytest.approx(2, rel=0.1)


def test_a_ray_moved_along_itself_sees_the_same_point():
    field, (p, v) = _field(), _lines(500)
    torch.testing.assert_close(field.depth(p + 0.3 * v, v), field.depth(p, v) - 0.3)


def test_normals_are_those_of_the_depth():
    field, (p, v) = _field(), _lines(300)
    step = 1e-6
    moved = [(field.depth(p + step * e, v) - field.depth(p - step * e, v)) / (2 * step) for e in torch.eye(3).double()]
    truth = derivatives.normals(torch.stack(moved, dim=-1), v)
    with torch.inference_mode():
        torch.testing.assert_close(field.normals(p.clone(), v.clone()), truth, rtol=0, atol=1e-5)


def test_gradient_reaches_the_networks_that_are_asked_alone():
    networks = _field().networks.requires_grad_()
    raw = cell_fields.outputs(networks, torch.tensor([3, 1, 3]), torch.randn(4, 3).double())
    for gradient in torch.autograd.grad(raw.square().sum(), list(networks.parameters())):
        reached = gradient.flatten(1).abs().sum(-1) > 0
        assert torch.nonzero(reached).squeeze(-1).tolist() == [1, 3]


def test_a_network_that_sees_nothing_has_no_say_in_depth():
    field, (p, v) = _field(), _lines(500)
    assert bool(torch.isinf(_field(-5.0).depth(p, v)).all())
    found = cells.pairs(p, v, LAYOUT, UPPER)
    row = int((torch.bincount(found.rows) == 2).nonzero()[0])
    one, other = torch.nonzero(found.rows == row).squeeze(-1)
    more, less = (one, other) if found.weights[one] > found.weights[other] else (other, one)
    field.networks.shifts[-1][found.cells[less], 0, pddf.VISIBILITY_ROW] = -0.1
    raw = cell_fields.outputs(field.networks, found.cells[more, None], found.local[:, more, None])
    truth = found.before[more] + raw[0, 0] * found.rate[more]
    torch.testing.assert_close(field.depth(p[row, None], v[row, None])[0], truth)


def test_a_lesson_keeps_every_pair_with_its_network():
    seen = _seen(2_000)
    taught, which = cell_fields.lesson(seen, LAYOUT, UPPER)
    found = cells.pairs(seen.positions, seen.directions, LAYOUT, UPPER)
    assert int(taught.count.sum()) == len(found.rows) == len(taught.z)
    assert sorted(which[which >= 0].tolist()) == list(range(len(taught.count)))
    rows = taught.drawn(np.random.default_rng(0), 5).reshape(-1, 5)
    assert bool(((rows >= taught.first[:, None]) & (rows < (taught.first + taught.count)[:, None])).all())
    hit = seen.truth.visible[found.rows]
    depth = found.before[hit] + found.rate[hit] * torch.zeros(int(hit.sum()))
    own = (seen.truth.depth[found.rows[hit]] - depth) / found.rate[hit]
    torch.testing.assert_close(own.sort().values.float(), taught.z[taught.visible > 0].sort().values, atol=1e-5, rtol=0)
    assert 0 < float(own.min()) and float(own.max()) < 2 * SIDE


def _section() -> fit_settings.FitConfig:
    section = config.load(measuring.ROOT / "configs/fit.yaml", "fit", fit_settings.FitConfig)
    loop = dataclasses.replace(section.loop, threads=1, learning_rate=1e-2, muon=None)
    return dataclasses.replace(section, loop=loop)


def test_a_trained_one_learns_a_ball():
    field = cell_fields.fit(LAYOUT, (12, 12), 1.0, _seen(20_000), UPPER, _section(), 32, 200)
    held_out = _seen(1_000, 1)
    with torch.inference_mode():
        depth = field.depth(held_out.positions, held_out.directions)
        both = torch.isfinite(depth) & held_out.truth.visible
        normals = field.normals(held_out.positions[both], held_out.directions[both])
    assert float((torch.isfinite(depth) != held_out.truth.visible).float().mean()) < 0.1
    assert float((depth - held_out.truth.depth)[both].abs().median()) < 0.05
    assert float((normals * held_out.truth.normals[both]).sum(-1).median()) > 0.97
