"""The Chamfer loss and its nearest points."""

import pytest
import torch

from ddf.fields import losses
from ddf.training import reconstruction_steps


def test_chamfer_loss_equals_the_double_loop():
    generator = torch.Generator().manual_seed(0)
    a = torch.randn(2, 7, 3, generator=generator, dtype=torch.float64, requires_grad=True)
    b = torch.randn(2, 5, 3, generator=generator, dtype=torch.float64)
    distance = torch.cdist(a, b).square()
    expected = distance.amin(2).mean() + distance.amin(1).mean()
    torch.testing.assert_close(reconstruction_steps.chamfer_loss(a, b), expected)
    assert torch.autograd.gradcheck(lambda x: reconstruction_steps.chamfer_loss(x, b), (a,))


def test_chamfer_loss_is_the_same_in_blocks(monkeypatch):
    generator = torch.Generator().manual_seed(1)
    a, b = torch.randn(3, 40, 3, generator=generator), torch.randn(3, 90, 3, generator=generator)
    whole = reconstruction_steps.chamfer_loss(a, b)
    for block in (1, 40 * 7, 40 * 90, 2 * 40 * 90):  # a column, seven, a shape, two shapes at a time
        monkeypatch.setitem(losses.BLOCK_VALUES, "cpu", block)
        assert reconstruction_steps.chamfer_loss(a, b) == whole


@pytest.mark.parametrize(("count", "others"), [(7, 33), (40, 96), (1, 5), (64, 32)])
def test_nearest_points_are_those_of_all_distances(count, others):
    """Whole numbers as coordinates: many distances are equal, and of these the first one counts."""
    generator = torch.Generator().manual_seed(0)
    a, b = (torch.randint(-2, 3, (3, size, 3), generator=generator).float() for size in (count, others))
    dist_sq = (a[:, :, None] - b[:, None]).square().sum(-1)
    to_truth, to_predicted = reconstruction_steps._nearest(a, b)
    assert torch.equal(to_truth, dist_sq.argmin(2))
    assert torch.equal(to_predicted, dist_sq.argmin(1))
