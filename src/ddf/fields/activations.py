"""Activations of depth, d = φ(y) >= 0 of a raw output y, with the first and second derivative that the passes read.

β is the sharpness: the larger, the nearer to ReLU. Far below zero ReLU has no gradient and softplus one that falls as
e^(βy), which is none in float32 once y < -1 with β = 100: a component that gets there stays there. Squareplus (Barron
2021; with b = 4/β²) falls as 1/(βy)² and so always comes back.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn


@dataclass(frozen=True)
class Activation:
    """φ, φ' and φ'', each of (raw values, β)."""

    value: Callable[[Float[Tensor, "*n"], float], Float[Tensor, "*n"]]
    slope: Callable[[Float[Tensor, "*n"], float], Float[Tensor, "*n"]]
    bend: Callable[[Float[Tensor, "*n"], float], Float[Tensor, "*n"]]


def _root(raw: Tensor, sharpness: float) -> Tensor:
    return torch.sqrt(raw.square() + 4 / sharpness**2)


def squareplus(raw: Float[Tensor, "*n"], sharpness: float) -> Float[Tensor, "*n"]:
    """(y + r)/2 with r = sqrt(y² + 4/β²), which is 1/β at 0; below zero as (2/β²)/(r - y), where nothing cancels."""
    below = raw.clamp(max=0.0)
    falling = 2 / sharpness**2 / (_root(below, sharpness) - below)
    return torch.where(raw >= 0, (raw + _root(raw, sharpness)) / 2, falling)


ACTIVATIONS = {
    "relu": Activation(
        lambda raw, sharpness: torch.relu(raw),
        lambda raw, sharpness: (raw > 0).to(raw.dtype),
        lambda raw, sharpness: torch.zeros_like(raw),
    ),
    "softplus": Activation(
        lambda raw, sharpness: nn.functional.softplus(raw, beta=sharpness),
        lambda raw, sharpness: torch.sigmoid(sharpness * raw),
        lambda raw, sharpness: sharpness * torch.sigmoid(sharpness * raw) * torch.sigmoid(-sharpness * raw),
    ),
    "squareplus": Activation(
        squareplus,
        lambda raw, sharpness: squareplus(raw, sharpness) / _root(raw, sharpness),
        lambda raw, sharpness: 2 / sharpness**2 / _root(raw, sharpness) ** 3,
    ),
}
