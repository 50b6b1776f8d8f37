"""`cloud_projection.farthest_point_order` for Triton: one program has all points of a cloud in its registers.

One step waits for the last.

Products and sums are rounded one by one, as numpy's are, so that the order is the same.
"""

from typing import Any

import torch
import triton
import triton.language as tl
from jaxtyping import Float, Int
from torch import Tensor

WARPS = 32  # all that a program may have


@triton.jit
def _order(points, weights, order, n, count, block: tl.constexpr):
    place = tl.arange(0, block)
    inside = place < n
    x = tl.load(points + place, mask=inside, other=0.0)
    y = tl.load(points + n + place, mask=inside, other=0.0)
    z = tl.load(points + 2 * n + place, mask=inside, other=0.0)
    weight = tl.load(weights + place, mask=inside, other=0.0)
    scale = tl.where(inside, weight * weight, -1.0)  # what pads the block is never the farthest
    distance_sq = tl.full((block,), float("inf"), tl.float32)
    latest = tl.argmax(scale, axis=0)
    for i in range(count):
        tl.store(order + i, latest)
        dx, dy, dz = (
            x - tl.load(points + latest),
            y - tl.load(points + n + latest),
            z - tl.load(points + 2 * n + latest),
        )
        distance_sq = tl.minimum(distance_sq, dx * dx + dy * dy + dz * dz)
        latest = tl.argmax(distance_sq * scale, axis=0)


def order(points: Float[Tensor, "n 3"], count: int, weights: Float[Tensor, "n"]) -> Int[Tensor, "count"]:
    """`cloud_projection.farthest_point_order` with weights."""
    found = torch.zeros(count, dtype=torch.int32, device=points.device)
    axes = points.T.contiguous()
    how: dict[str, Any] = {"num_warps": WARPS, "enable_fp_fusion": False}
    how["block"] = triton.next_power_of_2(len(points))
    _order[(1,)](axes, weights.contiguous(), found, len(points), count, **how)
    return found.long()
