"""From images to cameras: the head that gives the scores units, and a statistics-aware encoder of them.

The paper's camera encoder is a network of images alone. The statistics-aware one (ours) also reads where the mask lies,
and gives the radius by the apparent size.
How large an object is seen says its distance as soon as its own size is known. So the network answers for the product
of radius and apparent size, which does not change with the distance (but for the perspective).
"""

import math
from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from ddf.core import checks
from ddf.models import encoders, reconstruction_settings

HIDDEN = 64  # features beside the numbers, as many as they become
NUMBERS = 10  # of `mask_numbers`
_SEEN = 0.02  # of an opaque pixel: less is outside the box
LEAST_PAIR = 0.05  # a (sin θ, cos θ) shorter than this says nothing; the slope of its angle is 1 / length


class CameraHead(nn.Module):
    """What the camera encoder gives to physical units, by the statistics of the training cameras.

    azimuth: `angle` is the paper's way, three z-scores, in which 0 and 2π are the farthest apart. `sincos` gives the
    azimuth as (sin θ, cos θ), which has no end, before the z-scores of elevation and radius; the two have unit variance
    together, as a z-score has, where azimuths are spread evenly (derived here).
    """

    mean: Tensor
    deviation: Tensor
    lowest: Tensor
    highest: Tensor

    def __init__(self, azimuth: reconstruction_settings.Azimuth = "angle") -> None:
        super().__init__()
        self.azimuth = azimuth
        self.register_buffer("mean", torch.zeros(3))
        self.register_buffer("deviation", torch.ones(3))
        self.register_buffer("lowest", torch.full((3,), -torch.inf))
        self.register_buffer("highest", torch.full((3,), torch.inf))

    def fit(self, training_cameras: Float[Tensor, "n 3"]) -> None:
        """Take mean, deviation and range from the training set; InputError where one of the three never varies, or
        there are not two cameras.
        """
        if len(training_cameras) < 2:
            raise checks.InputError(f"training cameras must be at least 2; got {len(training_cameras)}")
        deviation = training_cameras.std(dim=0)
        if not bool((deviation > 0).all()):
            raise checks.InputError(f"azimuth, elevation and radius must vary over the training set; got {deviation}")
        self.mean.copy_(training_cameras.mean(dim=0))
        self.deviation.copy_(deviation)
        self.lowest.copy_(training_cameras.amin(dim=0))
        self.highest.copy_(training_cameras.amax(dim=0))

    @property
    def num_scores(self) -> int:
        """Numbers that the encoder gives."""
        return 3 if self.azimuth == "angle" else 4

    def loss(self, scores: Float[Tensor, "b scores"], truth: Float[Tensor, "b 3"]) -> Float[Tensor, ""]:
        """L_Π = ‖Π_g - Π̂‖² of the scores, mean over images; before clamping, so that its gradient never dies."""
        wanted = (truth - self.mean) / self.deviation
        if self.azimuth == "sincos":
            wanted = torch.cat((torch.sin(truth[:, :1]), torch.cos(truth[:, :1]), wanted[:, 1:]), dim=-1)
        return (scores - wanted).square().sum(-1).mean()

    def forward(self, scores: Float[Tensor, "b scores"]) -> Float[Tensor, "b 3"]:
        """Cameras, clamped to the range of the training set; an azimuth from (sin θ, cos θ) is in [0, 2π) instead.

        A pair shorter than `LEAST_PAIR` gives azimuth 0 and no gradient: L_Π alone draws it out.
        """
        last = scores if self.azimuth == "angle" else scores[:, 1:]
        camera = last * self.deviation + self.mean
        bounded = torch.minimum(torch.maximum(camera, self.lowest), self.highest)
        return bounded if self.azimuth == "angle" else torch.cat((_angle(scores[:, :2]), bounded[:, 1:]), dim=-1)


def _angle(pair: Float[Tensor, "b 2"]) -> Float[Tensor, "b 1"]:
    """θ in [0, 2π) of (sin θ, cos θ) of any length."""
    sine, cosine = pair[:, :1], pair[:, 1:]
    undecided = sine.square() + cosine.square() < LEAST_PAIR**2
    angle = torch.atan2(torch.where(undecided, 0.0, sine), torch.where(undecided, 1.0, cosine))
    return torch.where(angle < 0, angle + 2 * math.pi, angle)


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


class StatisticsAwareEncoder(nn.Module):
    """RGBA images to camera scores, the radius's last, in place of the plain encoder that it has inside."""

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
        """Take the statistics of masks and radii from the training set."""
        numbers = mask_numbers(alpha)
        self.mean.copy_(numbers.mean(dim=0))
        self.deviation.copy_(numbers.std(dim=0).clamp_min(1e-3))
        self.spread.copy_(radii.std() / radii.mean())

    def forward(self, images: Float[Tensor, "b 4 h w"]) -> Float[Tensor, "b scores"]:
        """Scores of `CameraHead`: with a last answer a, the radius is its mean times exp(spread a) / (s / mean s)."""
        numbers = mask_numbers(images[:, 3])
        statistics = self.numbers((numbers - self.mean) / self.deviation)
        answers = self.scores(functional.relu(self.encoder(images) + statistics))
        nearer = (numbers[:, :1] - self.mean[:1]).clamp(-math.log(4), math.log(4))
        radius = torch.exp(self.spread * answers[:, -1:] - nearer)  # over its mean
        return torch.cat((answers[:, :-1], (radius - 1) / self.spread), dim=1)
