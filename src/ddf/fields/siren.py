"""Sine networks, the modulator that conditions them, and activations of depth.

Sources: Sitzmann et al. 2020; Mehta et al. 2021; [DDF22] app. C, E. Letters: x input, a_l = W_l h_{l-1} + b_l,
h_l = m_l sin(ω_l a_l), m_l modulation (1 where there is none) and y = W h_L + b. Points of one shape share their
modulation: inputs are (*shapes, n, in), modulations (*shapes, 1, width).

Depth is d = φ(y) >= 0 of a raw output y. β is its sharpness: the larger, the nearer to ReLU. Far below zero ReLU has no
gradient and softplus one that falls as e^(βy), which is none in float32 once y < -1 with β = 100: a component that gets
there stays there.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import cast

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ddf.core import checks
from ddf.core.schema import setting


@dataclass(frozen=True)
class Activation:
    """φ and φ', each of (raw values, β)."""

    value: Callable[[Float[Tensor, "*n"], float], Float[Tensor, "*n"]]
    slope: Callable[[Float[Tensor, "*n"], float], Float[Tensor, "*n"]]


ACTIVATIONS = {
    "relu": Activation(lambda raw, sharpness: torch.relu(raw), lambda raw, sharpness: (raw > 0).to(raw.dtype)),
    "softplus": Activation(
        lambda raw, sharpness: nn.functional.softplus(raw, beta=sharpness),
        lambda raw, sharpness: torch.sigmoid(sharpness * raw),
    ),
}


SOFTPLUS_INVERSE_OF_ONE = math.log(math.e - 1)  # a modulator's bias, so that modulations start at about 1


@dataclass(frozen=True)
class SineLayout:
    """Sizes and frequencies of a sine network.

    omega_first multiplies the first layer's pre-activation and is not divided out of its weights: it sets the bandwidth
    in (p, v). omega_hidden multiplies the others and is divided out of their initial weights: it sets only how fast
    they learn.
    """

    hidden: tuple[int, ...] = setting((512,) * 7, "widths of the sine layers", "app. singlefits")
    omega_first: float = setting(1.0, "ω of the first layer: bandwidth in (p, v)", "app. singlefits")
    omega_hidden: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "hidden", tuple(self.hidden))
        if not 0 < len(self.hidden) <= 256 or min(self.hidden) < 1:
            raise checks.InputError(f"hidden must list at least one positive width; got {self.hidden}")
        if not (self.omega_first > 0 and self.omega_hidden > 0):
            raise checks.InputError(f"omega must be positive; got {self.omega_first}, {self.omega_hidden}")


class SineNetwork(nn.Module):
    """Multilayer perceptron with sine activations and a linear head.

    Initial weights are U(±sqrt(6/fan_in)/ω_hidden) for the hidden layers and the head (Sitzmann et al. 2020, §3.2) and
    U(±sqrt(6/fan_in)) for the first layer, as in the code that [DDF22] cites; biases start at U(±1/sqrt(fan_in)).
    """

    def __init__(self, in_features: int, layout: SineLayout, out_features: int) -> None:
        super().__init__()
        widths = (in_features, *layout.hidden)
        layers = nn.ModuleList(nn.Linear(a, b) for a, b in itertools.pairwise(widths))
        self.layers = cast(Sequence[nn.Linear], layers)
        self.head = nn.Linear(widths[-1], out_features)
        self.omegas = (layout.omega_first, *([layout.omega_hidden] * (len(layout.hidden) - 1)))
        for index, layer in enumerate((*self.layers, self.head)):
            bound = math.sqrt(6.0 / layer.in_features) / (1.0 if index == 0 else layout.omega_hidden)
            nn.init.uniform_(layer.weight, -bound, bound)

    def forward(
        self, inputs: Float[Tensor, "*batch in"], modulations: Sequence[Tensor] | None = None
    ) -> Float[Tensor, "*batch out"]:
        """Values only; `derivatives` has the passes that give derivatives too."""
        hidden, in_place = inputs, not torch.is_grad_enabled()
        for index, layer in enumerate(self.layers):
            hidden = scaled_linear(hidden, layer, self.omegas[index])
            hidden = hidden.sin_() if in_place else hidden.sin()
            if modulations is not None:
                hidden = hidden.mul_(modulations[index]) if in_place else hidden * modulations[index]
        return self.head(hidden)


def scaled_linear(inputs: Float[Tensor, "*batch in"], layer: nn.Linear, omega: float) -> Float[Tensor, "*batch out"]:
    """ω (W x + b), with ω folded into the parameters so that no pass over the points is spent on it."""
    if omega == 1.0:
        return nn.functional.linear(inputs, layer.weight, layer.bias)
    return nn.functional.linear(inputs, layer.weight * omega, layer.bias * omega)


class Modulator(nn.Module):
    """Latent z to one positive modulation per sine layer: m_0 = softplus(W z), m_l = softplus(W [m_{l-1}, z]).

    Source: Mehta et al. 2021, with the softplus of [DDF22] app. E in place of their ReLU.
    """

    def __init__(self, latent_features: int, hidden: Sequence[int]) -> None:
        super().__init__()
        inputs = [latent_features, *(width + latent_features for width in hidden[:-1])]
        layers = nn.ModuleList(nn.Linear(a, b) for a, b in zip(inputs, hidden, strict=True))
        self.layers = cast(Sequence[nn.Linear], layers)
        for layer in self.layers:
            nn.init.constant_(layer.bias, SOFTPLUS_INVERSE_OF_ONE)

    def forward(self, latent: Float[Tensor, "*shapes z"]) -> list[Float[Tensor, "*shapes 1 _"]]:
        """One modulation per layer, with an axis of length 1 for the points of the shape."""
        modulations = []
        features = latent
        for layer in self.layers:
            modulation = nn.functional.softplus(layer(features))
            modulations.append(modulation.unsqueeze(-2))
            features = torch.cat((modulation, latent), dim=-1)
        return modulations


def hidden_matrices(module: nn.Module) -> list[nn.Parameter]:
    """Weights between the sine layers, and of the modulators, anywhere in a module; not of first layers and heads."""
    found = []
    for part in module.modules():
        if isinstance(part, SineNetwork):
            found += [layer.weight for layer in part.layers[1:]]
        elif isinstance(part, Modulator):
            found += [layer.weight for layer in part.layers]
    return found
