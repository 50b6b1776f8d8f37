"""A small convolutional network from a camera to an image of depths and visibilities. [DDF22] app. `neurren`.

The camera enters as the rays (C_p, v) of its pixels, at a quarter, at half and at the full size of the image; sine
layers of 3 x 3 convolutions go from the coarse image to the fine one. A pixel so depends on rays around its own: it is
no field that is asked ray by ray, but every property of a field holds of an exact one's pixels (`image_properties`).

Depth is counted from where a ray passes the middle of the shape, d = -C_p · v + r: the network gives r, which is small.

Derivatives in the camera are one tangent pass: a layer sin(a), a = W * x, turns the tangent t of x into cos(a) (W * t).
Six tangents are all there are: three ways to move, three axes to turn about.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ddf.core import checks
from ddf.fields.renderers import image_properties

DEPTH, VISIBILITY = 0, 1  # channels of the output; the second is a logit
TANGENTS = 6  # of a camera: moved along three axes, turned about three


@dataclass(frozen=True)
class RendererLayout:
    """Sizes. image: pixels a side. widths: channels of the two layers at a quarter of it, of one at half, of two at the
    full size, the last of which has a kernel of one pixel. omega: bandwidth in (p, v).
    """

    image: int = 32
    widths: tuple[int, int, int, int, int] = (64, 64, 32, 24, 24)
    omega: float = 2.0

    def __post_init__(self) -> None:
        if self.image < 4 or self.image % 4:
            raise checks.InputError(f"the image's side must be a multiple of 4; got {self.image}")


_LEVELS = (4, 4, 2, 1, 1)  # the layers' share of the image's side
_KERNELS = (3, 3, 3, 3, 1)
_FRESH = (0, 2, 3)  # layers that take the rays of their level in


class DepthRenderer(nn.Module):
    """Cameras to images of depth and visibility logits."""

    def __init__(self, layout: RendererLayout) -> None:
        super().__init__()
        self.layout = layout
        before = (0, *layout.widths[:-1])
        layers = nn.ModuleList(
            nn.Conv2d(a + (6 if index in _FRESH else 0), b, kernel, padding=kernel // 2)
            for index, (a, b, kernel) in enumerate(zip(before, layout.widths, _KERNELS, strict=True))
        )
        self.layers = cast(Sequence[nn.Conv2d], layers)
        self.head = nn.Conv2d(layout.widths[-1], 2, 1)
        for layer in (*self.layers, self.head):  # as sine networks, `siren.SineNetwork`
            bound = math.sqrt(6.0 / (layer.in_channels * math.prod(layer.kernel_size)))
            nn.init.uniform_(layer.weight, -bound, bound)

    def forward(self, views: image_properties.Views) -> Float[Tensor, "n 2 h w"]:
        """Values alone."""
        raw = self._run(views, False)[0]
        return raw + _middle(views, views.directions(self.layout.image))

    def with_derivatives(
        self, views: image_properties.Views
    ) -> tuple[Float[Tensor, "n 2 h w"], Float[Tensor, "n 2 h w 3"], Float[Tensor, "n 2 h w 3"]]:
        """Values, and their derivatives in the camera's position and in its turn: `moved`, `turned`."""
        raw, tangents = self._run(views, True)
        assert tangents is not None
        by_axis, directions = tangents.unflatten(0, (TANGENTS, -1)).movedim(0, -1), views.directions(self.layout.image)
        turns = -torch.linalg.cross(directions, views.positions[:, None, None].expand_as(directions))
        moved, turned = (
            added + torch.stack((plain, torch.zeros_like(plain)), 1)
            for added, plain in ((by_axis[..., :3], -directions), (by_axis[..., 3:], turns))
        )
        return raw + _middle(views, directions), moved, turned

    def _run(self, views: image_properties.Views, derivatives: bool) -> tuple[Tensor, Tensor | None]:
        hidden, tangents, size = None, None, 0
        for index, layer in enumerate(self.layers):
            if _LEVELS[index] != (_LEVELS[index - 1] if index else 0):
                size = self.layout.image // _LEVELS[index]
                hidden, tangents = _finer(hidden), _finer(tangents)
            if index in _FRESH:
                rays = self.layout.omega * _rays(views, size)
                hidden = rays if hidden is None else torch.cat((hidden, rays), 1)
                if derivatives:
                    turns = self.layout.omega * _ray_tangents(views, size)
                    tangents = turns if tangents is None else torch.cat((tangents, turns), 1)
            angle = layer(hidden)
            hidden = angle.sin()
            if tangents is not None:
                along = nn.functional.conv2d(tangents, layer.weight, padding=_KERNELS[index] // 2)
                tangents = (along.unflatten(0, (TANGENTS, -1)) * angle.cos()).flatten(0, 1)
        if tangents is not None:
            tangents = nn.functional.conv2d(tangents, self.head.weight)
        return self.head(hidden), tangents


def _middle(views: image_properties.Views, directions: Float[Tensor, "n h w 3"]) -> Float[Tensor, "n 2 h w"]:
    """-C_p · v in the channel of the depth."""
    way = -(views.positions[:, None, None] * directions).sum(-1)
    return torch.stack((way, torch.zeros_like(way)), 1)


def _finer(values: Tensor | None) -> Tensor | None:
    """Every pixel four times."""
    return None if values is None else values.repeat_interleave(2, -1).repeat_interleave(2, -2)


def _rays(views: image_properties.Views, size: int) -> Float[Tensor, "n 6 h w"]:
    """(C_p, v) of every pixel as channels."""
    directions = views.directions(size)
    return torch.cat((views.positions[:, None, None].expand_as(directions), directions), -1).movedim(-1, 1)


def _ray_tangents(views: image_properties.Views, size: int) -> Float[Tensor, "m 6 h w"]:
    """What moving along and turning about each axis does to the rays: (e_k, 0) and (0, e_k × v), m = 6 n."""
    directions = views.directions(size)
    axes = torch.eye(3).to(directions)[:, None, None, None].expand(3, *directions.shape)
    nothing = torch.zeros_like(axes)
    moved = torch.cat((axes, nothing), -1)
    turned = torch.cat((nothing, torch.linalg.cross(axes, directions.expand_as(axes))), -1)
    return torch.cat((moved, turned)).flatten(0, 1).movedim(-1, 1)
