"""Which of several rays from a point leads to the nearest visible surface. [DDF22] §4.2-4.3."""

import torch
from jaxtyping import Float
from torch import Tensor

# a mean direction shorter than this has cancelled (a point between two sheets): take the best candidate
SMALL_MEAN = 0.05


def closest_directions(
    candidates: Float[Tensor, "n k 3"],
    visibilities: Float[Tensor, "n k"],
    depths: Float[Tensor, "n k"],
    temperature: float,
    inverse_depth: float,
) -> Float[Tensor, "n 3"]:
    """v̂*, the normalised mean of the candidates with weights softmax_k(ξ_k / (η_T (ε_s + d_k))).

    Where the mean all but vanishes, the heaviest candidate is taken instead (derived here).

    Args:
      candidates: unit directions. depths: field units. temperature: η_T. inverse_depth: ε_s.
    """
    score = visibilities / (temperature * (inverse_depth + depths))
    weights = torch.softmax(score, dim=-1)
    mean = (weights[..., None] * candidates).sum(dim=-2)
    best = candidates[torch.arange(len(candidates), device=candidates.device), weights.argmax(dim=-1)]
    length = mean.norm(dim=-1, keepdim=True)
    return torch.where(length < SMALL_MEAN, best, mean / length.clamp_min(SMALL_MEAN))
