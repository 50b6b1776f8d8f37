"""Training images varied on the fly, as renders of other programs and cut-outs of photographs vary (ours).

Each image gets its own colours, blur, shift of the crop and hardness of the alpha's edge. Cameras, shapes and the masks
of L_M stay as they are, so shifts must be small. Numbers are drawn for all images of a step from the step's own
generator: a resumed training and one of several processes see the same images.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from ddf.core import arrays, checks, names

LEAST_WIDTH = 0.05  # pixels: a Gaussian that blurs nothing
LEAST_ALPHA = 1 / 510  # half a step of eight bits: less is nothing


Largest = Mapping[str, float]  # change by name, drawn evenly down to none


def check(largest: Largest) -> None:
    """Raise unless the largest changes have known names and are in range.

    colour: of the logarithm of brightness, a third of it also of each channel, and of the power of the half tones.
    blur: standard deviation, pixels of the encoders' input. shift: pixels of it, right or left and up or down. alpha:
    of the logarithm of the power to which alpha is taken.
    """
    for name, value in largest.items():
        if name not in _MOST:
            raise checks.InputError(f"augmentation: unknown name {name!r}; the names are {names.known(name, _MOST)}")
        if not 0 <= value <= _MOST[name]:
            raise checks.InputError(f"augmentation.{name} must be in [0, {_MOST[name]:g}]; got {value}")


def numbers(count: int, random: np.random.Generator, part: slice) -> Float[Tensor, "b numbers"]:
    """Random numbers in [-1, 1) for `part` of so many images, drawn for all."""
    return torch.from_numpy(random.uniform(-1, 1, (count, NUMBERS))[part].astype(np.float32))


def vary(
    images: Float[Tensor, "b 4 h w"], chances: Float[Tensor, "b numbers"], largest: Largest
) -> Float[Tensor, "b 4 h w"]:
    """Images in [0, 1], changed by as much as `chances` in [-1, 1) say; RGB is 0 where alpha is 0."""
    whole = dict.fromkeys(_MOST, 0.0) | dict(largest)
    own = arrays.send(chances, images.device).split([each.numbers for each in AUGMENTATIONS], dim=1)
    for each, part in zip(AUGMENTATIONS, own, strict=True):
        if any(whole[key] for key in each.largest):
            images = each.change(images, part, whole)
    return images


def _coloured(
    images: Float[Tensor, "b 4 h w"], chances: Float[Tensor, "b 5"], largest: Largest
) -> Float[Tensor, "b 4 h w"]:
    gains = largest["colour"] * (chances[:, :1] + chances[:, 1:4] / 3)
    power = (largest["colour"] * chances[:, 4:5]).exp()[..., None, None]
    rgb = (images[:, :3].clamp_min(0) ** power * gains.exp()[..., None, None]).clamp(0, 1)
    return torch.cat((rgb, images[:, 3:]), dim=1)


def _hardened(
    images: Float[Tensor, "b 4 h w"], chances: Float[Tensor, "b 1"], largest: Largest
) -> Float[Tensor, "b 4 h w"]:
    alpha = images[:, 3:] ** (largest["alpha"] * chances).exp()[..., None, None]
    shown = alpha >= LEAST_ALPHA
    return torch.cat((images[:, :3] * shown, alpha * shown), dim=1)


def _moved(
    images: Float[Tensor, "b 4 h w"], chances: Float[Tensor, "b 3"], largest: Largest
) -> Float[Tensor, "b 4 h w"]:
    """Blurred and shifted, colours as much as they are opaque."""
    spread = torch.cat((images[:, :3] * images[:, 3:], images[:, 3:]), dim=1)
    width = (largest["blur"] * chances[:, :1].abs()).clamp_min(LEAST_WIDTH)
    for axis, row in ((-1, 1), (-2, 2)):
        spread = _along(spread, width, largest["shift"] * chances[:, row : row + 1], axis, _reach(largest))
    alpha = spread[:, 3:] * (spread[:, 3:] >= LEAST_ALPHA)
    rgb = torch.where(alpha > 0, spread[:, :3] / spread[:, 3:].clamp_min(LEAST_ALPHA), 0.0)
    return torch.cat((rgb, alpha), dim=1).clamp(0, 1)


def _reach(largest: Largest) -> int:
    """Pixels beside the middle one that the widest, farthest kernel needs."""
    return math.ceil(largest["shift"]) + math.ceil(3 * largest["blur"])


def _along(
    images: Float[Tensor, "b c h w"], width: Float[Tensor, "b 1"], by: Float[Tensor, "b 1"], axis: int, reach: int
) -> Float[Tensor, "b c h w"]:
    """Each image blurred by a Gaussian of its own width and moved by its own pixels along one axis; 0 comes in.

    Between pixels it is interpolated: the kernel is the mean of those of the two whole shifts beside `by`.
    """
    count, channels = images.shape[:2]
    places = torch.arange(-reach, reach + 1, device=images.device, dtype=images.dtype)
    whole = by.floor()
    kernels = torch.zeros(count, len(places), device=images.device, dtype=images.dtype)
    for shift, share in ((whole, 1 - by + whole), (whole + 1, by - whole)):
        kernels = kernels + share * torch.softmax(-0.5 * ((places + shift) / width) ** 2, dim=1)
    shape, padding = ((1, -1), (0, reach)) if axis == -1 else ((-1, 1), (reach, 0))
    weights = kernels.repeat_interleave(channels, dim=0)[:, None].unflatten(2, shape)
    planes = images.reshape(1, count * channels, *images.shape[2:])
    return torch.nn.functional.conv2d(planes, weights, padding=padding, groups=count * channels).reshape(images.shape)


@dataclass(frozen=True)
class Augmentation:
    """One change of images. largest: its keys in the config and how large they may be. numbers: drawn per image."""

    largest: dict[str, float]
    numbers: int
    change: Callable[[Tensor, Tensor, Largest], Tensor]


AUGMENTATIONS = (  # in this order; a new one is an entry here, a function above and its key in the config
    Augmentation({"colour": 2.0}, 5, _coloured),
    Augmentation({"alpha": 2.0}, 1, _hardened),
    Augmentation({"blur": 4.0, "shift": 8.0}, 3, _moved),
)
NUMBERS = sum(each.numbers for each in AUGMENTATIONS)
_MOST = {key: most for each in AUGMENTATIONS for key, most in each.largest.items()}
