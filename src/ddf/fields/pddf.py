"""Probabilistic directed distance fields, plain and conditional, and the point-cloud decoder of the baseline.

A PDDF maps (p, v) to two depths d_i, their weights w_i and a visibility ξ. Source: [DDF22] §3.3 with K = 2. The
network's raw outputs are (d_1, d_2, logit w_1, logit ξ) before any activation. Every loss works on logits.
"""

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from ddf.core import schema
from ddf.core.schema import setting
from ddf.fields import siren

NUM_COMPONENTS = 2  # the paper's K
DIRECTION = slice(3, 6)  # of the inputs (p, v)
WEIGHT_ROW, VISIBILITY_ROW, NUM_OUTPUTS = 2, -1, 4  # the first and the last of two components
INITIAL_DEPTH = 1.0  # both depth biases start here: a ReLU that starts below zero never learns

DepthActivation = Literal["relu", "softplus"]


@dataclass(frozen=True)
class PDDFConfig(schema.Checked):
    """The directed distance field of a model. softplus is within log(2)/β of ReLU (`siren`)."""

    hidden: tuple[int, ...] = setting((512,) * 7, "widths of the sine layers", "app. singlefits")
    omega_first: float = setting(1.0, "ω of the first layer: bandwidth in (p, v)", "app. singlefits")
    omega_hidden: float = 1.0
    depth_activation: DepthActivation = setting(
        "relu", "of depths; the gradient of relu dies below zero, softplus's lives", "app. singlefits"
    )
    depth_sharpness: float = setting(100.0, "β of softplus(βx)/β; relu has none", above=0, most=1e6)
    direction_scale: float = setting(1.0, "first weights of v, as a multiple of those of p; less fits faster", above=0)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.layout()

    def layout(self) -> siren.SineLayout:
        """Sizes and frequencies of the sine network."""
        return siren.SineLayout(self.hidden, self.omega_first, self.omega_hidden)


PAPER_SINGLE_SHAPE = PDDFConfig()


class PDDF(nn.Module):
    """A sine network on (p, v) with the outputs of a probabilistic DDF; conditional where modulations are given."""

    def __init__(self, config: PDDFConfig) -> None:
        super().__init__()
        self.config = config
        self.network = siren.SineNetwork(DIRECTION.stop, config.layout(), NUM_OUTPUTS)
        with torch.no_grad():
            self.network.layers[0].weight[:, DIRECTION] *= config.direction_scale
        nn.init.constant_(self.network.head.bias[:NUM_COMPONENTS], INITIAL_DEPTH)

    def forward(
        self,
        positions: Float[Tensor, "*batch 3"],
        directions: Float[Tensor, "*batch 3"],
        modulations: list[Tensor] | None = None,
    ) -> Float[Tensor, "*batch out"]:
        """Raw outputs at oriented points of the field frame; see `visibility`, `depth`."""
        return self.network(self.inputs(positions, directions), modulations)

    def inputs(
        self, positions: Float[Tensor, "*batch 3"], directions: Float[Tensor, "*batch 3"]
    ) -> Float[Tensor, "*batch 6"]:
        """What the network is asked: (p, v)."""
        return torch.cat((positions, directions), dim=-1)

    @property
    def activation(self) -> siren.Activation:
        """Of depth; its functions take the sharpness of the config."""
        return siren.ACTIVATIONS[self.config.depth_activation]

    def depths(self, raw: Float[Tensor, "*batch out"]) -> Float[Tensor, "*batch k"]:
        """d_1, d_2 >= 0, field units."""
        return self.activation.value(raw[..., :NUM_COMPONENTS], self.config.depth_sharpness)

    def depth_slopes(self, raw: Float[Tensor, "*batch out"]) -> Float[Tensor, "*batch k"]:
        """∂d_i/∂raw_i, the factor between a raw derivative and that of the depth."""
        return self.activation.slope(raw[..., :NUM_COMPONENTS], self.config.depth_sharpness)

    def depth(self, raw: Float[Tensor, "*batch out"]) -> Float[Tensor, "*batch"]:
        """d_{i*}, the depth of the heaviest component; only that one's activation is evaluated."""
        chosen = torch.where(first_is_heavier(raw), raw[..., 0], raw[..., 1])
        return self.activation.value(chosen, self.config.depth_sharpness)


class ConditionalPDDF(nn.Module):
    """A PDDF whose sine layers are modulated by a shape latent z_s. Source: [DDF22] §4.3, app. E."""

    def __init__(self, config: PDDFConfig, latent_features: int) -> None:
        super().__init__()
        self.field = PDDF(config)
        self.modulator = siren.Modulator(latent_features, config.hidden)

    def modulations(self, latent: Float[Tensor, "*b z"]) -> list[Float[Tensor, "*b 1 _"]]:
        """One modulation per sine layer and shape."""
        return self.modulator(latent)


@torch.no_grad()
def baked(field: PDDF, modulations: Sequence[Float[Tensor, "1 _"]]) -> PDDF:
    """A conditional field of one shape as a plain one: W_{l+1} (m_l h) = (W_{l+1} diag m_l) h."""
    plain = copy.deepcopy(field).requires_grad_(False).eval()
    with torch.no_grad():
        for layer, modulation in zip((*plain.network.layers[1:], plain.network.head), modulations, strict=True):
            layer.weight.mul_(modulation)
    return plain


class PointDecoder(nn.Module):
    """PC-SIREN: a modulated sine network from p ~ U[-1,1]^3 to a point of the shape. Source: [DDF22] app. E."""

    def __init__(self, layout: siren.SineLayout, latent_features: int) -> None:
        super().__init__()
        self.network = siren.SineNetwork(3, layout, 3)
        self.modulator = siren.Modulator(latent_features, layout.hidden)

    def forward(
        self, seeds: Float[Tensor, "*shapes n 3"], latent: Float[Tensor, "*shapes z"]
    ) -> Float[Tensor, "*shapes n 3"]:
        """Points of the shapes, field frame."""
        return self.network(seeds, self.modulator(latent))


def first_is_heavier(raw: Float[Tensor, "*batch 4"]) -> Bool[Tensor, "*batch"]:
    """i* = 1, that is w_1 >= 1/2."""
    return raw[..., WEIGHT_ROW] >= 0


def scores(raw: Float[Tensor, "*batch out"]) -> Float[Tensor, "*batch k"]:
    """s_1, ..., s_K, whose softmax the weights are; K = 2 but for `soft_rays`. s_K is 0."""
    return torch.cat((raw[..., raw.shape[-1] // 2 : -1], torch.zeros_like(raw[..., :1])), dim=-1)


def weights(raw: Float[Tensor, "*batch 4"]) -> Float[Tensor, "*batch 2"]:
    """w_1, w_2."""
    first = torch.sigmoid(raw[..., WEIGHT_ROW])
    return torch.stack((first, 1 - first), dim=-1)


def heavier_rows(raw: Float[Tensor, "*batch 4"]) -> Float[Tensor, "*batch 2"]:
    """One-hot rows of i*: the cotangents by which an adjoint pass gives the gradient of raw d_{i*}."""
    first = first_is_heavier(raw).to(raw.dtype)
    return torch.stack((first, 1 - first), dim=-1)


def visibility(raw: Float[Tensor, "*batch out"]) -> Float[Tensor, "*batch"]:
    """ξ in [0, 1]."""
    return torch.sigmoid(raw[..., VISIBILITY_ROW])


def count_parameters(module: nn.Module) -> int:
    """Number of trained values."""
    return sum(parameter.numel() for parameter in module.parameters())
