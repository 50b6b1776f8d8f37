"""Soft edges of patches: shares of a disc over an edge, gradients against differences, silhouettes that descend."""

import numpy as np
import pytest
import torch
from _shapes import cube, icosphere
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
