"""Soft edges of patches: shares of a disc over an edge, gradients against differences, silhouettes that descend."""

import numpy as np
import pytest
import torch
from _shapes import cube, icosphere, moved
from torch.nn import functional

from ddf.fields import pddf
from ddf.fields.grid import octree, patch_field, soft_rays
from ddf.fit import fit_folder


def _soft(mesh, radius: float) -> soft_rays.SoftPatches:
    fitted = patch_field.fitted(*fit_folder.in_cube(mesh), octree.PatchConfig())
    return soft_rays.SoftPatches(patch_field.of(*fitted), radius)


def test_visibility_falls_over_an_edge_as_the_share_of_the_disc_and_is_certain_elsewhere():
    soft, side = _soft(cube(), 0.1), 1 - patch_field.MARGIN
    x = np.linspace(-0.3, 0.3, 601) + side
    starts = torch.from_numpy(np.stack((x, np.full_like(x, 0.1), np.full_like(x, 3.0)), -1)).requires_grad_()
    ways = torch.tensor([[0.0, 0.0, -1.0]], dtype=torch.float64).repeat(len(x), 1).requires_grad_()
    logit = soft(starts, ways)[:, pddf.VISIBILITY_ROW]
    share = (torch.sigmoid(logit).detach().numpy() * (soft_rays.COUNT + 1) - 0.5) / soft_rays.COUNT
    inside = np.clip((side - x) / 0.1, -1, 1)
    exact = 0.5 + (inside * np.sqrt(1 - inside**2) + np.arcsin(inside)) / np.pi  # of the disc that lies over the plate
    assert np.abs(share - exact).max() < 0.15 and np.abs(share - exact).mean() < 0.015
    slope, turned = torch.autograd.grad(torch.sigmoid(logit).sum(), (starts, ways))
    assert slope[torch.from_numpy(np.abs(x - side) > 0.11)].abs().max() < 1e-9
    assert np.trapezoid(slope[:, 0].numpy(), x) == pytest.approx(-1, abs=0.03)  # the whole fall, from 1 to 0
    assert (slope[:, 0] <= 1e-9).all() and slope[:, 2].abs().max() == 0
    torch.testing.assert_close(turned, (3 - side) * slope, rtol=1e-4, atol=1e-9)  # the edge is so far away


def test_gradients_of_depths_are_differences_of_depths():
    soft, random = _soft(icosphere(5), 0.02), np.random.default_rng(0)
    starts = torch.from_numpy(random.uniform(-0.4, 0.4, (200, 3))).requires_grad_()
    ways = functional.normalize(torch.from_numpy(random.standard_normal((200, 3))), dim=-1).requires_grad_()

    def mean_depth(p: torch.Tensor, v: torch.Tensor) -> torch.Tensor:
        return soft.depths(soft(p, v)) @ torch.linspace(0, 1, soft_rays.COUNT).double()

    slopes = torch.autograd.grad(mean_depth(starts, ways).sum(), (starts, ways))
    step = torch.from_numpy(random.standard_normal((2, 200, 3)))
    step[1] -= (step[1] * ways).sum(-1, keepdim=True) * ways
    for row, slope in enumerate(slopes):
        by = 1e-5 * step[row]
        ends = [
            mean_depth(starts + sign * by * (row == 0), functional.normalize(ways + sign * by * (row == 1), dim=-1))
            for sign in (1, -1)
        ]
        off = (ends[0] - ends[1]) / 2e-5 - (slope * step[row]).sum(-1)
        assert off.abs().quantile(0.9) < 1e-4 * (slope * step[row]).sum(-1).abs().mean()


def test_a_shape_is_found_by_its_silhouettes_alone():
    shape = moved(cube(), np.array([1.0, 0.5, 0.7]), (0.0, 0.0, 0.0))
    soft, size = _soft(shape, 0.1), 24
    grid = torch.linspace(-1.4, 1.4, size, dtype=torch.float64)
    across = torch.stack(torch.meshgrid(grid, grid, indexing="ij"), -1).reshape(-1, 2)
    starts, ways = [], []
    for axis in range(3):  # three pictures
        place = torch.full((len(across), 3), 3.0, dtype=torch.float64)
        place[:, [(axis + 1) % 3, (axis + 2) % 3]] = across
        starts.append(place)
        ways.append(-torch.eye(3, dtype=torch.float64)[axis].expand_as(place))
    starts, ways = torch.cat(starts), torch.cat(ways)
    wanted = torch.from_numpy(soft.field.evaluate(starts.numpy(), ways.numpy(), ("visibility",))["visibility"])
    shift = torch.tensor([0.12, -0.15, 0.1], dtype=torch.float64, requires_grad=True)
    optimiser, losses = torch.optim.Adam([shift], lr=0.01), []
    for _ in range(60):
        logits = soft(starts - shift, ways)[:, pddf.VISIBILITY_ROW]
        loss = functional.binary_cross_entropy_with_logits(logits, wanted)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(float(loss.detach()))
    assert losses[-1] < 0.6 * losses[0] and float(shift.detach().abs().max()) < 0.015
