"""A camera encoder that is told where the mask lies, and that gives the radius by the apparent size (ours).

How large an object is seen says its distance as soon as its own size is known. So the network answers for the product
of radius and apparent size, which does not change with the distance (but for the perspective).
"""

import math
from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from ddf.models import encoders

HIDDEN = 64  # features beside the numbers, as many as they become
NUMBERS = 10  # of `mask_numbers`
_SEEN = 0.02  # of an opaque pixel: less is outside the box


def mask_numbers(alpha: Float[Tensor, "b h w"]) -> Float[Tensor, "b 10"]:
    """Size and place of the mask in half sides of the image, x right, y down.

    The logarithm of its size s, the root of the mean squared distance from its centre; the centre; the variance in x
    and the covariance over s²; the root of the area over s; left, right, upper and lower end from the centre over s.
    """
    ends, sums = [], []
    for axis in (-2, -1):
        length = alpha.shape[-1 if axis == -2 else -2]
        pixel, strip = torch.arange(length, device=alpha.device, dtype=alpha.dtype), alpha.amax(dim=axis)
        first = torch.where(strip > _SEEN, pixel + 1 - strip, length).amin(dim=1)
        last = torch.where(strip > _SEEN, pixel + strip, 0).amax(dim=1)
        ends.append((first * 2 / length - 1, last * 2 / length - 1))
        sums.append((pixel + 0.5) * 2 / length - 1)
    mass = alpha.sum(dim=(1, 2)).clamp_min(1)
    across, down = sums
    x, y = (alpha.sum(dim=1) * across).sum(dim=1) / mass, (alpha.sum(dim=2) * down).sum(dim=1) / mass
    from_x, from_y = across - x[:, None], down - y[:, None]
    xx = (alpha.sum(dim=1) * from_x.square()).sum(dim=1) / mass
    yy = (alpha.sum(dim=2) * from_y.square()).sum(dim=1) / mass
    xy = (alpha * from_x[:, None] * from_y[:, :, None]).sum(dim=(1, 2)) / mass
    size = (xx + yy).clamp_min(4 / math.prod(alpha.shape[1:])).sqrt()
    area = (mass * 4 / math.prod(alpha.shape[1:])).sqrt()
    (left, right), (top, bottom) = ends
    over = (xx / size, xy / size, area, left - x, right - x, top - y, bottom - y)
    return torch.stack((size.log(), x, y, *(each / size for each in over)), dim=1)


class ToldEncoder(nn.Module):
    """As the encoder inside, which it takes the place of: RGBA images to camera scores, the radius's last."""

    mean: Tensor
    deviation: Tensor
    spread: Tensor

    def __init__(self, make: Callable[[int, int], encoders.Encoder], num_scores: int, width: int) -> None:
        super().__init__()
        self.encoder = make(HIDDEN, width)
        self.numbers = nn.Linear(NUMBERS, HIDDEN)
        self.scores = nn.Linear(HIDDEN, num_scores)
        self.register_buffer("mean", torch.zeros(NUMBERS))
        self.register_buffer("deviation", torch.ones(NUMBERS))
        self.register_buffer("spread", torch.tensor(0.1))

    def fit(self, alpha: Float[Tensor, "n h w"], radii: Float[Tensor, "m"]) -> None:
        """Take what is usual from masks and radii of the training set."""
        numbers = mask_numbers(alpha)
        self.mean.copy_(numbers.mean(dim=0))
        self.deviation.copy_(numbers.std(dim=0).clamp_min(1e-3))
        self.spread.copy_(radii.std() / radii.mean())

    def forward(self, images: Float[Tensor, "b 4 h w"]) -> Float[Tensor, "b scores"]:
        """Scores of `CameraHead`: with a last answer a, the radius is its mean times exp(spread a) / (s / usual s)."""
        numbers = mask_numbers(images[:, 3])
        told = self.numbers((numbers - self.mean) / self.deviation)
        answers = self.scores(functional.relu(self.encoder(images) + told))
        nearer = (numbers[:, :1] - self.mean[:1]).clamp(-math.log(4), math.log(4))
        radius = torch.exp(self.spread * answers[:, -1:] - nearer)  # over its mean
        return torch.cat((answers[:, :-1], (radius - 1) / self.spread), dim=1)
