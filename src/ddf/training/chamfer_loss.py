"""The Chamfer loss of point clouds, the largest number of distances at a time that stays in cache."""

import math

import torch
from jaxtyping import Float, Int
from torch import Tensor

from ddf.fields import losses

GROUP = 32  # distances of which the least is found first, at most


def chamfer_loss(predicted: Float[Tensor, "b n 3"], truth: Float[Tensor, "b m 3"]) -> Float[Tensor, ""]:
    """D_C: sum of the two means of squared distances to the nearest neighbour, mean over shapes.

    The neighbours are found without gradient; only the pairs that count are differentiated.
    """
    to_truth, to_predicted = _nearest(predicted.detach(), truth)
    near_truth = truth.gather(1, to_truth[..., None].expand(-1, -1, 3))
    near_predicted = predicted.gather(1, to_predicted[..., None].expand(-1, -1, 3))
    there = (predicted - near_truth).square().sum(-1).mean()
    return there + (truth - near_predicted).square().sum(-1).mean()


def _nearest(
    predicted: Float[Tensor, "b n 3"], truth: Float[Tensor, "b m 3"]
) -> tuple[Int[Tensor, "b n"], Int[Tensor, "b m"]]:
    """Index of the nearest true point of each predicted one, and the other way round, in blocks that stay in cache."""
    n, m = predicted.shape[1], truth.shape[1]
    block = losses.block_values(predicted.device)
    shapes, columns = max(1, block // (n * m)), max(1, block // n)
    to_truth, to_predicted = [], []
    for own, others in zip(predicted.split(shapes), truth.split(shapes), strict=True):
        nearest = torch.full(own.shape[:2], torch.inf, dtype=own.dtype, device=own.device)
        index = torch.zeros(own.shape[:2], dtype=torch.int64, device=own.device)
        back, start = [], 0
        for part in others.split(columns, dim=1):
            dist_sq = torch.baddbmm(
                own.square().sum(-1, keepdim=True) + part.square().sum(-1)[:, None], own, part.mT, alpha=-2
            )
            back.append(_argmin(dist_sq, 1)[1])
            least, place = _argmin(dist_sq, 2)
            index = torch.where(least < nearest, place + start, index)
            nearest = torch.minimum(least, nearest)
            start += part.shape[1]
        to_truth.append(index)
        to_predicted.append(torch.cat(back, dim=1))
    return torch.cat(to_truth), torch.cat(to_predicted)


def _argmin(values: Float[Tensor, "b n m"], dim: int) -> tuple[Float[Tensor, "b _"], Int[Tensor, "b _"]]:
    """The least along an axis and its index, the first of several: of groups first, as values alone are found some
    seven times as fast as with their index.
    """
    size = math.gcd(values.shape[dim], GROUP)
    groups = values.unflatten(dim, (-1, size))
    chosen = groups.amin(dim + 1).argmin(dim).unsqueeze(dim)
    least, place = groups.take_along_dim(chosen.unsqueeze(dim + 1), dim).min(dim + 1)
    return least.squeeze(dim), (chosen * size + place).squeeze(dim)
