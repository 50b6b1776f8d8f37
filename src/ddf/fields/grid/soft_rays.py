"""Rays of patches whose edges are soft, with gradients, for who asks where a field stands.

A ray is asked as a bundle of `COUNT` parallel ones through a disc across it. Visibility is the share of these that meet
a patch; their depths are components of equal weights. Gradients: of depths by Properties II and III; of visibility that
of the plane of least squares through the bundle's, zero where all agree. A turn moves a silhouette by its depth, as
Property III says of a surface (derived here).
"""

import math
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from ddf.fields import derivatives
from ddf.fields.grid import patch_field

COUNT = 12  # rays of a bundle
_NO_WEIGHT = -30.0  # score of a component that meets nothing
_GRAZING = 0.1  # least |n · v| of a gradient: no ray outweighs ten


class SoftPatches:
    """Patches in the place of a `pddf.PDDF` of `COUNT` components.

    Args:
      radius: of the disc, field units.
    """

    def __init__(self, field: patch_field.PatchField, radius: float) -> None:
        self.field, self.radius = field, radius

    def __call__(
        self, positions: Float[Tensor, "*batch 3"], directions: Float[Tensor, "*batch 3"], modulations: None = None
    ) -> Float[Tensor, "*batch out"]:
        """Raw outputs, field frame; differentiable once."""
        raw: Any = _Bundle.apply(positions, directions, self)
        return raw

    def depths(self, raw: Float[Tensor, "*batch out"]) -> Float[Tensor, "*batch k"]:
        """Of the rays of the bundle, 0 of those that meet nothing."""
        return raw[..., :COUNT]


def disc() -> Float[Tensor, "k 2"]:
    """Even points of a disc of radius 1: rings of 4 and 8, so that their mean is 0 and their spread that of no axis."""
    turn = 2 * math.pi * torch.cat((torch.arange(4) / 4, (torch.arange(8) + 0.5) / 8)).double()
    radius = torch.tensor([0.41] * 4 + [0.82] * 8, dtype=torch.float64)
    return radius[:, None] * torch.stack((turn.cos(), turn.sin()), -1)


class _Bundle(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, positions: Tensor, directions: Tensor, soft: SoftPatches) -> Tensor:
        starts, ways = (each.reshape(-1, 3).double() for each in (positions, directions))
        points, axes = soft.radius * disc(), torch.stack(derivatives.tangent_basis(ways), 1)
        off = points @ axes  # (n, k, 3)
        asked = (starts[:, None] + off).reshape(-1, 3), ways.repeat_interleave(COUNT, 0)
        found = soft.field.evaluate(asked[0].numpy(), asked[1].numpy(), ("visibility", "depth", "normals"))
        met, depths, normals = (
            torch.from_numpy(found[name]).reshape(len(ways), COUNT, *found[name].shape[1:])
            for name in ("visibility", "depth", "normals")
        )
        slopes = normals / (-normals @ ways[..., None]).clamp_min(_GRAZING)  # ∇_p d = -n / (n · v)
        count = met.sum(1, keepdim=True)
        share = (count + 0.5) / (COUNT + 1)
        tilt = (met[..., None] * off).sum(1) / (points.square().sum() / 2 * share * (1 - share))
        reach = (met * depths).sum(1, keepdim=True) / count.clamp_min(1)
        scores = _NO_WEIGHT * (1 - met)
        ctx.save_for_backward(*(each.to(positions) for each in (slopes, depths, tilt, reach)))
        raw = torch.cat((depths, scores[:, :-1] - scores[:, -1:], torch.logit(share)), 1)
        return raw.to(positions).reshape(*positions.shape[:-1], -1)

    @staticmethod
    def backward(ctx: Any, *upstream: Tensor) -> tuple[Tensor | None, ...]:
        slopes, depths, tilt, reach = ctx.saved_tensors
        given, shape = upstream[0].flatten(0, -2), (*upstream[0].shape[:-1], 3)
        of_depths, of_edge = given[:, :COUNT, None] * slopes, given[:, -1:] * tilt
        of_directions = (depths[..., None] * of_depths).sum(1) + reach * of_edge
        return (of_depths.sum(1) + of_edge).reshape(shape), of_directions.reshape(shape), None
