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
        starts, ways = (each.reshape(-1, 3).double() for each in (positions, directions))
        off = self.radius * disc() @ torch.stack(derivatives.tangent_basis(ways), 1)  # (n, k, 3)
        raw: Any = _Bundle.apply(starts[:, None] + off, ways[:, None].expand(off.shape), off.detach(), self)
        return raw.to(positions).reshape(*positions.shape[:-1], raw.shape[-1])

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
    def forward(ctx: Any, starts: Tensor, ways: Tensor, off: Tensor, soft: SoftPatches) -> Tensor:
        asked = starts.reshape(-1, 3).numpy(), ways.reshape(-1, 3).numpy()
        found = soft.field.evaluate(*asked, ("visibility", "depth", "normals"))
        met, depths, normals = (
            torch.from_numpy(found[name]).reshape(*off.shape[:2], *found[name].shape[1:])
            for name in ("visibility", "depth", "normals")
        )
        slopes = normals / -(normals * ways).sum(-1, keepdim=True).clamp_max(-_GRAZING)  # ∇_p d = -n / (n · v)
        count = met.sum(1, keepdim=True)
        share = (count + 0.5) / (COUNT + 1)
        spread = (soft.radius * disc()).square().sum() / 2 * share * (1 - share)
        tilt = (met[..., None] * off).sum(1) / spread
        reach = (met * depths).sum(1, keepdim=True) / count.clamp_min(1)
        scores = _NO_WEIGHT * (1 - met)
        ctx.save_for_backward(slopes, depths, tilt, reach)
        return torch.cat((depths, scores[:, :-1] - scores[:, -1:], torch.logit(share)), 1)

    @staticmethod
    def backward(ctx: Any, *upstream: Tensor) -> tuple[Tensor | None, ...]:
        slopes, depths, tilt, reach = ctx.saved_tensors
        of_depths = upstream[0][:, :COUNT, None] * slopes
        of_edge = (upstream[0][:, -1:] * tilt)[:, None] / COUNT  # of every ray: those that turning moves add up to 0
        return of_depths + of_edge, depths[..., None] * of_depths + reach[:, None] * of_edge, None, None
