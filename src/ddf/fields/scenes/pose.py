"""Where an object stands, by gradient descent through its field on a depth image: scenes are differentiable in poses.

An object at the pose (R, t) answers a ray (p, v) of the scene as its field answers (Rᵀ (p - t), Rᵀ v). R = exp([ω]_×).
Loss: mean |d - d̂| over pixels that both see, plus the cross entropy of visibility over all pixels that meet the box.
"""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from ddf.fields import pddf
from ddf.geometry import cameras, rays

SEEN = 0.5
_RATE = 0.02  # of Adam, radians and units of the field
_VISIBILITY = 0.05  # weight of the cross entropy


@runtime_checkable
class Holder(Protocol):
    """What has a network and its box, such as a `shape_field.ShapeField`."""

    @property
    def field(self) -> pddf.PDDF:
        """The network."""
        ...

    @property
    def lower(self) -> Float[np.ndarray, "3"]:
        """Lower corner of the box."""
        ...

    @property
    def upper(self) -> Float[np.ndarray, "3"]:
        """Upper corner of the box."""
        ...


@dataclass(frozen=True)
class Pose:
    """turn: ω, axis times angle in radians. shift: t. The frame and the unit of the field."""

    turn: Float[Tensor, "3"]
    shift: Float[Tensor, "3"]

    def rotation(self) -> Float[Tensor, "3 3"]:
        """R = exp([ω]_×), differentiable at ω = 0 too."""
        x, y, z = self.turn
        zero = torch.zeros_like(x)
        rows = (torch.stack((zero, -z, y)), torch.stack((z, zero, -x)), torch.stack((-y, x, zero)))
        return torch.linalg.matrix_exp(torch.stack(rows))


@dataclass(frozen=True)
class Image:
    """What a camera sees along given rays: visibility as a probability or 0 and 1, depth where it is at least 1/2."""

    visibility: Float[Tensor, "n"]
    depth: Float[Tensor, "n"]


def image_rays(
    size: int, azimuth_deg: float = 35.0, elevation_deg: float = 20.0, radius: float = 4.2
) -> tuple[Float[Tensor, "n 3"], Float[Tensor, "n 3"]]:
    """Starts and directions of a camera that looks at the origin of the field's frame, float32; radius in its unit."""
    pixels = cameras.pixel_directions(size, torch.zeros(0, dtype=torch.float64)).reshape(-1, 3)
    angles = torch.deg2rad(torch.tensor([azimuth_deg, elevation_deg], dtype=torch.float64))
    centre, world = cameras.pixel_rays(angles[0], angles[1], torch.tensor(radius, dtype=torch.float64), pixels)
    return centre.expand_as(world).float().contiguous(), world.float()


def render(shape: Holder, at: Pose, view: tuple[Float[Tensor, "n 3"], Float[Tensor, "n 3"]]) -> Image:
    """What the camera sees of an object at a pose; differentiable in the pose. Rays that miss the box see nothing."""
    raw, distance, meets = _ask(shape, at, view)
    visibility, depth = torch.zeros(len(meets)), torch.zeros(len(meets))
    visibility[meets] = pddf.visibility(raw)
    depth[meets] = shape.field.depth(raw) + distance
    return Image(visibility, depth)


def recover(
    shape: Holder, image: Image, view: tuple[Float[Tensor, "n 3"], Float[Tensor, "n 3"]], steps: int = 150
) -> Pose:
    """The pose from which the image was taken, by Adam from the pose at rest; the rate falls to zero by a cosine."""
    turn, shift = (torch.zeros(3, requires_grad=True) for _ in range(2))
    optimiser = torch.optim.Adam([turn, shift], lr=_RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    image = Image(image.visibility.detach(), image.depth.detach())
    seen = (image.visibility >= SEEN).float()
    for _ in range(steps):
        turn.grad, shift.grad = torch.autograd.grad(_loss(shape, image, seen, Pose(turn, shift), view), (turn, shift))
        optimiser.step()
        schedule.step()
    return Pose(turn.detach(), shift.detach())


def difference(one: Pose, other: Pose) -> tuple[float, float]:
    """Angle between two poses in degrees, and the distance of their origins."""
    between = one.rotation().T @ other.rotation()
    cosine = ((between.trace() - 1) / 2).clamp(-1, 1)
    return float(torch.rad2deg(torch.arccos(cosine))), float((one.shift - other.shift).norm())


def _loss(
    shape: Holder,
    image: Image,
    seen: Float[Tensor, "n"],
    at: Pose,
    view: tuple[Float[Tensor, "n 3"], Float[Tensor, "n 3"]],
) -> Float[Tensor, ""]:
    raw, distance, meets = _ask(shape, at, view)
    logits = raw[:, pddf.VISIBILITY_ROW]
    both = seen[meets] * (logits.detach() >= 0)
    off = (shape.field.depth(raw) + distance - image.depth[meets]).abs()
    depth = (both * off).sum() / both.sum().clamp_min(1)
    return depth + _VISIBILITY * functional.binary_cross_entropy_with_logits(logits, seen[meets])


def _ask(
    shape: Holder, at: Pose, view: tuple[Float[Tensor, "n 3"], Float[Tensor, "n 3"]]
) -> tuple[Float[Tensor, "m out"], Float[Tensor, "m"], Tensor]:
    """Raw outputs of the rays that meet the box, the way to it, and which rays these are."""
    rotation = at.rotation()
    positions, directions = (view[0] - at.shift) @ rotation, view[1] @ rotation
    lower, upper = (torch.from_numpy(corner).to(positions) for corner in (shape.lower, shape.upper))
    entry, distance, meets = rays.enter_box(positions, directions, lower, upper)
    return shape.field(entry[meets], directions[meets]), distance[meets], meets
