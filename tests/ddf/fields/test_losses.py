"""The fused shape loss against the plain way: one autograd call per derivative."""

import dataclasses
import math

import _models
import pytest
import torch
from _plain_loss import plain_loss

from ddf.fields import losses, pddf, siren

COUNTS = {"E": 3, "U": 5, "A": 6, "B": 4, "S": 2, "T": 3, "O": 2, "U+": 4, "B+": 1, "S+": 2, "P": 3}
WEIGHTS = losses.LossWeights(  # no two alike and none 1, so that none can stand for another or be left out
    normals=8.0, weight_variance=0.7, transition=0.15, visibility_variance=0.3, transition_speed=1.5
)


def _field(activation: pddf.DepthActivation = "softplus"):
    torch.manual_seed(0)
    return pddf.PDDF(pddf.PDDFConfig((12, 10), 2.0, 3.0, activation, 5.0)).double()


@pytest.mark.parametrize("activation", ["softplus", "relu"])
@pytest.mark.parametrize("modulated", [False, True])
def test_fused_loss_and_its_parameter_gradient_equal_the_plain_way(activation, modulated):
    field, batch, modulations = _field(activation), _models.batch(COUNTS), None
    parameters = list(field.parameters())
    if modulated:
        torch.manual_seed(3)
        modulator = siren.Modulator(4, (12, 10)).double()
        parameters += list(modulator.parameters())
        modulations = modulator(torch.randn(2, 4, dtype=torch.float64))
    expected = plain_loss(field, batch, modulations, WEIGHTS)
    slow = torch.autograd.grad(expected, parameters, retain_graph=True)
    found, terms = losses.shape_loss(field, batch, modulations, WEIGHTS)
    torch.testing.assert_close(found, expected, rtol=1e-10, atol=0)
    for mine, theirs in zip(torch.autograd.grad(found, parameters), slow, strict=True):
        assert theirs.abs().max() > 0
        assert (mine - theirs).abs().max() <= 1e-8 * theirs.abs().max()
    assert not any(term.requires_grad for term in terms.values())


def _loss(field, batch):
    return losses.shape_loss(field, batch, None, WEIGHTS)[0]


def test_huber_depth_error_is_quadratic_then_linear():
    error = torch.tensor([0.0, 0.01, 0.02, 0.52, -0.52])
    found = losses.depth_error(1 + error, torch.ones(5), 0.02)
    torch.testing.assert_close(found, torch.tensor([0.0, 0.0025, 0.01, 0.51, 0.51]))
    torch.testing.assert_close(losses.depth_error(1 + error, torch.ones(5)), error.square())


def test_mixture_depth_loss_weighs_both_components_and_moves_weight_to_the_better():
    field = _field("relu")
    raw = torch.tensor([[1.0, 3.0, 2.0, 0.0], [1.0, 3.0, -2.0, 0.0]], dtype=torch.float64, requires_grad=True)
    truth, visible = torch.full((2,), 1.5, dtype=torch.float64), torch.ones(2, dtype=torch.float64)
    mixture = dataclasses.replace(WEIGHTS, depth_of="mixture")
    found = losses.depth_loss(field, raw, truth, visible, mixture)
    heavy, light = 1 / (1 + math.exp(-2)), 1 / (1 + math.exp(2))
    assert found.tolist() == pytest.approx([heavy * 0.25 + light * 2.25, light * 0.25 + heavy * 2.25])
    (gradient,) = torch.autograd.grad(found.sum(), raw)
    assert bool((gradient[:, 2] < 0).all())  # both rows: more weight to the first, which is nearer to the truth
    chosen = losses.depth_loss(field, raw, truth, visible, WEIGHTS)
    assert chosen.tolist() == pytest.approx([0.25, 2.25])
    assert bool((torch.autograd.grad(chosen.sum(), raw)[0][:, 2] == 0).all())
    assert bool((losses.depth_loss(field, raw, truth, 0 * visible, mixture) == 0).all())


def test_gated_depth_loss_moves_a_weight_that_is_sure_and_wrong_and_teaches_both_components():
    field, gated = _field("relu"), dataclasses.replace(WEIGHTS, depth_of="gated")
    rows = [[1.0, 3.0, -40.0, 0.0], [1.0, 3.0, 40.0, 0.0], [3.0, 1.0, 40.0, 0.0]]
    raw = torch.tensor(rows, dtype=torch.float64, requires_grad=True)
    truth, visible = torch.full((3,), 1.5, dtype=torch.float64), torch.ones(3, dtype=torch.float64)
    gradient = torch.autograd.grad(losses.depth_loss(field, raw, truth, visible, gated).sum(), raw)[0]
    gap = 2.25 - 0.25
    assert gradient[:, 2].tolist() == pytest.approx([-gap, 0.0, gap], abs=1e-12)  # wrong, right, wrong
    share = losses.LEAST_SHARE
    assert gradient[0, :2].tolist() == pytest.approx([share * -1.0, (1 - share) * 3.0])  # d e_i = 2 (d_i - d)
    mixture = dataclasses.replace(gated, depth_of="mixture")
    dead = torch.autograd.grad(losses.depth_loss(field, raw, truth, visible, mixture).sum(), raw)[0]
    assert dead[0, 2].abs() < 1e-12 and dead[0, 0].abs() < 1e-12  # what the gated loss is for
    assert bool((losses.depth_loss(field, raw, truth, 0 * visible, gated) == 0).all())


def test_gated_depth_loss_is_least_where_the_weight_chooses_the_better_component():
    first, second = torch.full((9,), 0.1), torch.full((9,), 0.4)
    found = losses.gated_depth_error(first, second, torch.linspace(-8, 8, 9))
    assert bool((found.diff() < 0).all())
    assert float(found[-1]) == pytest.approx(0.1 + losses.LEAST_SHARE * 0.3, abs=1e-3)
    logit = torch.linspace(-8, 8, 9, requires_grad=True)
    slope = torch.autograd.grad(losses.gated_depth_error(first, second, logit).sum(), logit)[0]
    torch.testing.assert_close(slope, -0.3 * torch.sigmoid(-logit.detach()))  # of the cross-entropy alone
    same = losses.gated_depth_error(first, first, torch.linspace(-8, 8, 9))
    torch.testing.assert_close(same, first)  # of equal components no weight is better


def test_shape_loss_uses_the_huber_threshold():
    field, batch = _field(), _models.batch(COUNTS)
    wide = dataclasses.replace(WEIGHTS, depth_huber=1e9)  # no error is beyond it: e²/(2β)
    square, huber = (losses.shape_loss(field, batch, None, weights)[1]["depth"] for weights in (WEIGHTS, wide))
    assert float(2e9 * huber / square) == pytest.approx(1.0)


def test_ground_truth_of_extra_points_and_depth_of_misses_are_never_read():
    field, batch = _field(), _models.batch(COUNTS)
    extra = {name: getattr(batch, name).clone() for name in ("visible", "depth", "normals")}
    for values in extra.values():
        values[:, : COUNTS["E"]] = float("nan")
    misses = {"depth": torch.where(batch.visible > 0, batch.depth, float("nan"))}
    for spoiled in (extra, misses):
        found = _loss(field, dataclasses.replace(batch, **spoiled))
        assert torch.equal(_loss(field, batch), found)
        assert all(bool(g.isfinite().all()) for g in torch.autograd.grad(found, list(field.parameters())))


@pytest.mark.parametrize("points", [1, 4, 11, 36, 40, 80, 1000])
def test_blocks_are_the_batch_in_parts(points):
    numbers = torch.arange(3 * sum(COUNTS.values())).view(3, -1).double()
    batch = dataclasses.replace(_models.batch(COUNTS, 3), visible=numbers)
    rows = {kind: [] for kind in COUNTS}
    for shapes, block in batch.blocks(points):
        assert block.visible.shape == (shapes.stop - shapes.start, sum(block.counts.values()))
        assert block.visible.numel() <= max(points, 1)
        for kind in COUNTS:
            rows[kind] += block.visible[:, block.span(kind, kind)].flatten().tolist()
    for kind, found in rows.items():
        assert sorted(found) == sorted(batch.visible[:, batch.span(kind, kind)].flatten().tolist())


@pytest.mark.parametrize("points", [1, 5, 40])
def test_loss_and_gradient_do_not_depend_on_the_blocks(monkeypatch, points):
    field, batch = _field(), _models.batch(COUNTS)
    torch.manual_seed(3)
    modulator = siren.Modulator(4, (12, 10)).double()
    parameters = [*field.parameters(), *modulator.parameters()]

    def step():
        loss, terms = losses.shape_loss(field, batch, modulator(torch.ones(2, 4, dtype=torch.float64)), WEIGHTS)
        return [loss, *terms.values(), *torch.autograd.grad(3 * loss, parameters)]

    whole = step()
    monkeypatch.setattr(losses, "BLOCK_POINTS", points)
    monkeypatch.setattr(torch, "get_num_threads", lambda: 1)
    for mine, theirs in zip(step(), whole, strict=True):
        torch.testing.assert_close(mine, theirs, rtol=1e-10, atol=1e-12)


def test_loss_without_gradients_is_the_same_number():
    field, batch = _field(), _models.batch(COUNTS)
    with torch.no_grad():
        plain = _loss(field, batch)
    assert torch.equal(plain, _loss(field, batch).detach())


def test_transition_loss_is_quadratic_below_its_bound_and_nothing_above():
    assert float(losses.transition_loss(torch.tensor([-0.5]), 2.0)) == 2.25
    assert float(losses.transition_loss(torch.tensor([-3.0]), 2.0)) == 0.0
