"""The farthest-point order: a slow loop, weights, repeated points; and the kernel of a GPU, interpreted."""

import os
import subprocess
import sys

import pytest
import torch

from ddf.fields import cloud_projection


def test_farthest_points_equal_a_slow_loop():
    points = torch.rand(60, 3, generator=torch.Generator().manual_seed(0))
    order = cloud_projection.farthest_point_order(points, 20).tolist()
    assert order[0] == 0
    for i in range(1, 20):
        nearest = torch.cdist(points, points[order[:i]]).amin(dim=1)
        assert order[i] == int(nearest.argmax())


def test_weights_space_points_by_their_inverse():
    generator = torch.Generator().manual_seed(0)
    points = torch.rand(4000, 3, generator=generator)
    points[:, 2] = 0
    heavy = points[:, 0] > 0.5
    order = cloud_projection.farthest_point_order(points, 500, torch.where(heavy, 1.0, 0.5))
    assert heavy[order[0]]
    share = float(heavy[order].float().mean())
    assert share == pytest.approx(0.8, abs=0.03)  # spacing twice as wide: a quarter of the points on equal area


INTERPRETED = """
import torch
from ddf.fields import cloud_projection, farthest_kernel

random = torch.Generator().manual_seed(1)
for number, count in ((1, 1), (64, 64), (300, 40)):  # a block has a power of two
    points, weights = torch.randn((number, 3), generator=random), torch.rand(number, generator=random) + 0.1
    expected = cloud_projection.farthest_point_order(points, count, weights)
    assert torch.equal(farthest_kernel.order(points, count, weights), expected) and len(expected.unique()) == count
points, weights = torch.tensor([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]]), torch.tensor([0.5, 0.9, 0.9])
order = farthest_kernel.order(points, 5, weights)  # indices repeat once all places are taken: none of what pads a block
assert order.tolist() == cloud_projection.farthest_point_order(points, 5, weights).tolist() and int(order.max()) < 3
print("the same")
"""


def test_the_kernel_of_a_gpu_gives_the_order_of_numpy():
    pytest.importorskip("triton")
    environment = os.environ | {"TRITON_INTERPRET": "1"}  # asked for before Triton is imported: in another process
    done = subprocess.run([sys.executable, "-c", INTERPRETED], env=environment, capture_output=True, text=True)
    assert done.stdout == "the same\n", done.stderr[-2000:]


def test_the_kernel_takes_no_more_points_than_it_can_keep():
    found = [cloud_projection.fits(torch.zeros(count, 3, dtype=dtype)) for count, dtype in (
        (2**14, torch.float32), (2**14 + 1, torch.float32), (9, torch.float64),
    )]  # fmt: skip
    assert found == [True, False, False]


@pytest.mark.gpu
@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
def test_a_gpu_gives_the_order_of_the_cpu():
    random = torch.Generator().manual_seed(2)
    points, weights = torch.randn((11_000, 3), generator=random), torch.rand(11_000, generator=random) + 0.1
    expected = cloud_projection.farthest_point_order(points, 5000, weights)
    found = cloud_projection.farthest_point_order(points.cuda(), 5000, weights.cuda())
    assert found.is_cuda and torch.equal(found.cpu(), expected)
