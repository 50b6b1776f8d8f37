"""Activations of depth, d = φ(y) >= 0 of a raw output y, with the first and second derivative that the passes read.

β is the sharpness: the larger, the nearer to ReLU. Far below zero ReLU has no gradient and softplus one that falls as
e^(βy), which is none in float32 once y < -1 with β = 100: a component that gets there stays there.
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
}
