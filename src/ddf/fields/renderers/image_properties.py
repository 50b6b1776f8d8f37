"""What makes an image of depths a DDF of its pixels. [DDF22] app. `neurren`.

A pixel of a camera with position C_p and axes C_v is the oriented point (C_p, v) with v = C_vᵀ c for a fixed c. Moved
without turning it keeps v; turned by ω about C_p, v changes by ω × v and p stays. So with δ_p, δ_ω the derivatives of
a pixel's depth in the camera's position and turn,

  δ_p = ∇_p d              normals are ±δ_p/‖δ_p‖ (Property II, `derivatives.normals`), and δ_p · v = -1 (Property I)
  δ_ω = d (v × δ_p)        from ∇_v d (ω × v) = d ∇_p d (ω × v) for every ω (Property III)

whatever the network is. Letters: n cameras, images of h x w pixels. All in the frame of the shape.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ddf.geometry import cameras


@dataclass(frozen=True)
class Views:
    """Cameras. positions: C_p. axes: C_v, rows right, up and backwards, orthonormal."""

    positions: Float[Tensor, "n 3"]
    axes: Float[Tensor, "n 3 3"]

    def directions(self, size: int) -> Float[Tensor, "n size size 3"]:
        """v of every pixel, unit length, rows from the top; the lens is that of `cameras`."""
        pixels = cameras.pixel_directions(size, self.positions)
        return torch.einsum("hwi,nij->nhwj", pixels, self.axes)

    def chosen(self, which: Tensor) -> "Views":
        """Some of the cameras."""
        return Views(self.positions[which], self.axes[which])


def eikonal(moved: Float[Tensor, "n h w 3"], directions: Float[Tensor, "n h w 3"]) -> Float[Tensor, "n h w"]:
    """δ_p · v + 1, 0 for depths. Source: [DDF22] §3.1, Property I."""
    return (moved * directions).sum(-1) + 1


def gradient_consistency(
    depth: Float[Tensor, "n h w"],
    moved: Float[Tensor, "n h w 3"],
    turned: Float[Tensor, "n h w 3"],
    directions: Float[Tensor, "n h w 3"],
) -> Float[Tensor, "n h w 3"]:
    """δ_ω - d (v × δ_p), 0 for exact images. Source: [DDF22] §3.1, Property III; as a cross product derived here."""
    return turned - depth[..., None] * torch.linalg.cross(directions, moved)


def loss(
    visible: Bool[Tensor, "n h w"],
    depth: Float[Tensor, "n h w"],
    moved: Float[Tensor, "n h w 3"],
    turned: Float[Tensor, "n h w 3"],
    directions: Float[Tensor, "n h w 3"],
) -> tuple[Float[Tensor, ""], Float[Tensor, ""]]:
    """Mean squares of both residuals of the depth over all pixels, 0 where nothing is visible.

    The second is over d², so that it weighs the same from near and from afar (derived here).
    """
    along = eikonal(moved, directions).square()
    across = gradient_consistency(depth, moved, turned, directions).square().sum(-1) / depth.detach().square()
    return (visible * along).mean(), (visible * across).mean()
