"""A field whose small network belongs to the camera: fewer operations a ray, for pictures of outside cameras.

Letters: o the camera, a = -o/|o| the way to the box's centre, which is the origin; y = o + s v with s = |o|/(v · a),
where a ray meets the plane through the origin across a; t_0 = s - 1.5 R with R the radius of a sphere that holds
the box; d = t_0 + f(y; W(o)), with f >= 0 of a sine
network so small as a picture needs. Its weights W(o) come from another network, asked once a picture: a ray costs what
a function of two numbers costs, not one of five. What is given up: a ray by itself costs both networks, and two cameras
on one ray need not agree.

Normals (derived here): with o fixed, ∇_v d = s (g - a (1 + v · g)/(v · a)), g = ∇_y f, across v; by Property III of
[DDF22] §3.1, ∇_v d = d (I - v v^T) ∇_p d, and v · ∇_p d = -1, so n ∝ (∇_v d)/d - v.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from bench.rivals import ray_fields, rival_training
from ddf.fields import activations, derivatives, losses, pddf
from ddf.fit import fit_settings
from ddf.training import training_loop

BEFORE = 1.5  # radii, by which depth begins before the plane: no hit of a camera that sees the whole box lies earlier
_SOFTPLUS = activations.ACTIVATIONS["softplus"]
Weights = Sequence[tuple[Tensor, Tensor]]  # of each layer: (cameras, in, out), (cameras, 1, out)


@dataclass(frozen=True)
class ViewLayout:
    """hidden: widths of the camera's network. maker: widths of the one that makes its weights. omega: of the first
    layer of each.
    """

    hidden: tuple[int, ...]
    maker: tuple[int, ...]
    omega: float
    maker_omega: float


class WeightMaker(nn.Module):
    """W(o) from a and R/|o|: a sine network with as many outputs as the camera's network has weights.

    Each weight is that of one network, drawn as `siren` draws it, plus what the maker adds: nothing at first.
    """

    def __init__(self, layout: ViewLayout, radius: float) -> None:
        super().__init__()
        self.layout, self.radius = layout, radius
        self.shapes = list(itertools.pairwise((3, *layout.hidden, pddf.NUM_OUTPUTS)))
        widths = (4, *layout.maker)
        self.layers = nn.ModuleList(nn.Linear(a, b) for a, b in itertools.pairwise(widths))
        self.head = nn.Linear(widths[-1], sum((a + 1) * b for a, b in self.shapes))
        bounds = torch.cat([torch.full(((a + 1) * b,), math.sqrt(6 / a)) for a, b in self.shapes])
        with torch.no_grad():
            self.head.weight.mul_(0.1)
            self.head.bias.copy_((2 * torch.rand(len(bounds)) - 1) * bounds)

    def forward(self, cameras: Float[Tensor, "k 3"]) -> Weights:
        """Weights of each camera's network."""
        distance = cameras.norm(dim=-1, keepdim=True)
        hidden = torch.cat((-cameras / distance, self.radius / distance), dim=-1)
        for index, layer in enumerate(self.layers):
            hidden = torch.sin(layer(hidden) * (self.layout.maker_omega if index == 0 else 1.0))
        values, found = self.head(hidden), []
        for part, (a, b) in zip(values.split([(a + 1) * b for a, b in self.shapes], -1), self.shapes, strict=True):
            matrix, bias = part.split([a * b, b], -1)
            found.append((matrix.reshape(-1, a, b), bias[:, None]))
        (first, shift), *rest = found
        return [(first * self.layout.omega, shift * self.layout.omega), *rest]


def outputs(weights: Weights, y: Float[Tensor, "k n 3"]) -> Float[Tensor, "k n 4"]:
    """Of the cameras' networks, raw."""
    hidden, in_place = y, not torch.is_grad_enabled()
    for matrix, bias in weights[:-1]:
        hidden = torch.baddbmm(bias, hidden, matrix)
        hidden = hidden.sin_() if in_place else hidden.sin()
    return torch.baddbmm(weights[-1][1], hidden, weights[-1][0])


def slopes(weights: Weights, y: Float[Tensor, "k n 3"]) -> tuple[Float[Tensor, "k n 4"], Float[Tensor, "k n 3"]]:
    """Raw outputs, and ∇_y of the raw depth that is chosen."""
    hidden, rates = y, []
    for matrix, bias in weights[:-1]:
        angles = torch.baddbmm(bias, hidden, matrix)
        hidden = angles.sin()
        rates.append(angles.cos())
    raw = torch.baddbmm(weights[-1][1], hidden, weights[-1][0])
    gradient = pddf.heavier_rows(raw) @ weights[-1][0][..., : pddf.NUM_COMPONENTS].mT
    for (matrix, _), rate in zip(reversed(weights[:-1]), reversed(rates), strict=True):
        gradient = (gradient * rate) @ matrix.mT
    return raw, gradient


@dataclass(frozen=True)
class ViewField:
    """The maker, and the depth's activation as in `pddf`."""

    maker: WeightMaker
    sharpness: float

    def plane(
        self, o: Float[Tensor, "k 3"], v: Float[Tensor, "k n 3"]
    ) -> tuple[Float[Tensor, "k 1 3"], Float[Tensor, "k n 1"], Float[Tensor, "k n 3"]]:
        """a, s and y."""
        distance = o.norm(dim=-1, keepdim=True)
        a = (-o / distance)[:, None]
        s = distance[:, None] / (v @ a.mT)
        return a, s, o[:, None] + s * v

    def depth(self, o: Float[Tensor, "k 3"], v: Float[Tensor, "k n 3"]) -> Float[Tensor, "k n"]:
        """From each camera along its rays; `inf` where nothing is seen."""
        _, s, y = self.plane(o, v)
        raw = outputs(self.maker(o), y)
        f = _SOFTPLUS.value(chosen(raw), self.sharpness)
        return torch.where(raw[..., pddf.VISIBILITY_ROW] >= 0, s[..., 0] - BEFORE * self.maker.radius + f, torch.inf)

    def normals(self, o: Float[Tensor, "k 3"], v: Float[Tensor, "k n 3"]) -> Float[Tensor, "k n 3"]:
        """Unit, facing back, whether or not anything is seen."""
        a, s, y = self.plane(o, v)
        raw, gradient = slopes(self.maker(o), y)
        depth = chosen(raw)
        g = gradient * _SOFTPLUS.slope(depth, self.sharpness)[..., None]
        d = s - BEFORE * self.maker.radius + _SOFTPLUS.value(depth, self.sharpness)[..., None]
        turn = s * (g - a * (1 + (v * g).sum(-1, keepdim=True)) / (v @ a.mT))
        across = turn - v * (v * turn).sum(-1, keepdim=True)
        return derivatives.normals(across / d - v, v)


def chosen(raw: Float[Tensor, "*n 4"]) -> Float[Tensor, "*n"]:
    """Raw d_{i*}."""
    return torch.where(pddf.first_is_heavier(raw), raw[..., 0], raw[..., 1])


def fit(
    layout: ViewLayout,
    seen: ray_fields.SeenRays,
    radius: float,
    config: fit_settings.FitConfig,
    cameras: int,
    rays_each: int,
    steps: int,
) -> ViewField:
    """Trained on values, as `ray_fields.fit`, for so many steps on some rays of some cameras.

    Args:
      seen: of equally many rays from each camera, in order.
      radius: R.
      config: weights of the loss and loop.
    """
    training_loop.prepare(config.loop)
    starts, per = torch.unique_consecutive(seen.positions, dim=0, return_counts=True)
    each = int(per[0])
    field = ViewField(WeightMaker(layout, radius), config.field.depth_sharpness)
    v = seen.directions.reshape(-1, each, 3)
    truth, visible = seen.truth.depth.float().reshape(-1, each), seen.truth.visible.float().reshape(-1, each)
    _, s, y = field.plane(starts, v)
    f = torch.where(visible > 0, truth - s[..., 0] + BEFORE * radius, 0.0)
    with torch.no_grad():
        field.maker.head.bias[-pddf.NUM_OUTPUTS :][: pddf.NUM_COMPONENTS] = f[visible > 0].mean()

    def loss(step: int) -> tuple[Tensor, dict[str, Tensor]]:
        random = np.random.default_rng((config.loop.seed, step))
        who = torch.from_numpy(random.integers(0, len(starts), cameras))[:, None]
        rows = torch.from_numpy(random.integers(0, each, (cameras, rays_each)))
        raw = outputs(field.maker(starts[who[:, 0]]), y[who, rows])
        known, wanted = visible[who, rows], f[who, rows]
        depths = _SOFTPLUS.value(raw[..., : pddf.NUM_COMPONENTS], field.sharpness).unbind(-1)
        first, second = (losses.depth_error(depth, wanted, config.weights.depth_huber) for depth in depths)
        depth = (known * torch.lerp(second, first, torch.sigmoid(raw[..., pddf.WEIGHT_ROW]))).mean()
        silhouette = functional.binary_cross_entropy_with_logits(raw[..., pddf.VISIBILITY_ROW], known)
        return config.weights.depth * depth + config.weights.visibility * silhouette, {"depth": depth.detach()}

    rival_training.trained(field.maker, loss, steps, config.loop, "field of views")
    return field
