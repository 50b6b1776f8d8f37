"""The order in which each point of a cloud is the farthest from all before it: by numpy, on a GPU by one kernel.

The kernel needs Triton, which torch brings along on Linux. Where it is missing, and for very many points, numpy orders
those of a GPU too.
"""

import importlib.util

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

MOST_POINTS = 2**14  # that one program keeps beside its processor; more are numpy's


def farthest_point_order(
    points: Float[Tensor, "n 3"], count: int, weights: Float[Tensor, "n"] | None = None
) -> Int[Tensor, "count"]:
    """Indices in the order in which each point is the farthest from all before it, its distance times its weight.

    The first is the heaviest (point 0 without weights). Source: Gonzalez 1985; weights derived here. Costs n distances
    per index. With repeated points, indices repeat once all places are taken.

    Args:
      weights: > 0. Around points of weight w the spacing is proportional to 1 / w.
    """
    if points.is_cuda and fits(points) and importlib.util.find_spec("triton"):
        from ddf.fields.gpu import farthest_kernel

        return farthest_kernel.order(points, count, torch.ones_like(points[:, 0]) if weights is None else weights)
    x, y, z = np.ascontiguousarray(points.T.cpu().numpy())
    scale = np.ones(len(x), dtype=x.dtype) if weights is None else np.square(weights.cpu().numpy())
    distance_sq = np.full(len(x), np.inf, dtype=x.dtype)
    order = np.zeros(count, dtype=np.int64)
    order[0] = scale.argmax()
    for i in range(count - 1):
        latest = order[i]
        gap_sq = np.square(x - x[latest]) + np.square(y - y[latest]) + np.square(z - z[latest])
        np.minimum(distance_sq, gap_sq, out=distance_sq)
        order[i + 1] = (distance_sq if weights is None else distance_sq * scale).argmax()
    return torch.from_numpy(order).to(points.device)


def fits(points: Float[Tensor, "n 3"]) -> bool:
    """Whether the kernel takes these points."""
    return points.dtype == torch.float32 and len(points) <= MOST_POINTS
