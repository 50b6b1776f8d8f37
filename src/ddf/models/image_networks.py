"""The critic of 64 x 64 images, and the generator of the 2D GAN that has the same critic. Source: Lee and Town 2020.

Residual blocks of Mimicry, which [DDF22] app. genmodel cites, without spectral normalisation. A shortcut's 1 x 1
convolution commutes with averaging and with interpolation: it is done on the smaller image, at a quarter of the cost.
"""

import itertools

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

IMAGE_SIZE = 64
WIDTH = 1024  # of the layers at 4 x 4 pixels, in the paper
NOISE_FEATURES = 128
_SHARES = (1 / 16, 1 / 8, 1 / 4, 1 / 2, 1)  # of the width, from 32 x 32 pixels to 2 x 2 of the critic
SMALLEST = 4  # pixels a side of what the generator begins with


def _widths(width: int) -> list[int]:
    return [max(1, int(share * width)) for share in _SHARES]


class Critic(nn.Module):
    """D: logits of being real; five residual blocks that halve the image, sums over the last pixels, a linear layer."""

    def __init__(self, width: int = WIDTH) -> None:
        super().__init__()
        widths = _widths(width)
        self.first = _FirstDown(3, widths[0])
        self.blocks = nn.Sequential(*(_Down(a, b) for a, b in itertools.pairwise(widths)))
        self.head = nn.Linear(widths[-1], 1)
        _initialise(self)

    def forward(self, images: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b"]:
        """Of images in [-1, 1]."""
        hidden = torch.relu(self.blocks(self.first(images)))
        return self.head(hidden.sum(dim=(-2, -1)))[:, 0]


class Generator2D(nn.Module):
    """Noise to colours in [-1, 1], without any shape: the image GAN that [DDF22] compares with."""

    def __init__(self, width: int = WIDTH, noise_features: int = NOISE_FEATURES) -> None:
        super().__init__()
        widths = _widths(width)[::-1]
        self.noise_features = noise_features
        self.first = nn.Linear(noise_features, SMALLEST**2 * widths[0])
        self.blocks = nn.Sequential(*(_Up(a, b) for a, b in itertools.pairwise(widths)))
        self.last = nn.Sequential(
            nn.BatchNorm2d(widths[-1]), nn.ReLU(inplace=True), nn.Conv2d(widths[-1], 3, 3, padding=1), nn.Tanh()
        )
        _initialise(self)

    def forward(self, noise: Float[Tensor, "b z"]) -> Float[Tensor, "b 3 h w"]:
        """Images of N(0, I)."""
        hidden = self.first(noise).reshape(len(noise), -1, SMALLEST, SMALLEST)
        return self.last(self.blocks(hidden))


class _FirstDown(nn.Module):
    """Image to features of half its size."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.residual = nn.Sequential(
            nn.Conv2d(inputs, outputs, 3, padding=1),
            nn.ReLU(inplace=True),
            nn.Conv2d(outputs, outputs, 3, padding=1),
            nn.AvgPool2d(2),
        )
        self.shortcut = nn.Conv2d(inputs, outputs, 1)

    def forward(self, images: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c2 h2 w2"]:
        return self.residual(images) + self.shortcut(functional.avg_pool2d(images, 2))


class _Down(nn.Module):
    """Features to features of half the size."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.residual = nn.Sequential(
            nn.ReLU(),
            nn.Conv2d(inputs, inputs, 3, padding=1),
            nn.ReLU(inplace=True),
            nn.Conv2d(inputs, outputs, 3, padding=1),
            nn.AvgPool2d(2),
        )
        self.shortcut = nn.Conv2d(inputs, outputs, 1)

    def forward(self, images: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c2 h2 w2"]:
        return self.residual(images) + self.shortcut(functional.avg_pool2d(images, 2))


class _Up(nn.Module):
    """Features to features of twice the size."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.residual = nn.Sequential(
            nn.BatchNorm2d(inputs),
            nn.ReLU(inplace=True),
            _Doubled(),
            nn.Conv2d(inputs, outputs, 3, padding=1),
            nn.BatchNorm2d(outputs),
            nn.ReLU(inplace=True),
            nn.Conv2d(outputs, outputs, 3, padding=1),
        )
        self.shortcut = nn.Sequential(nn.Conv2d(inputs, outputs, 1), _Doubled())

    def forward(self, images: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c2 h2 w2"]:
        return self.residual(images) + self.shortcut(images)


class _Doubled(nn.Module):
    """Twice as large, by bilinear interpolation."""

    def forward(self, images: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c h2 w2"]:
        return functional.interpolate(images, scale_factor=2, mode="bilinear", align_corners=False)


def _initialise(network: nn.Module) -> None:
    """Mimicry's: Xavier's bounds, twice the variance inside residuals; biases 0."""
    for name, module in network.named_modules():
        if isinstance(module, nn.Conv2d | nn.Linear):
            nn.init.xavier_uniform_(module.weight, 2**0.5 if "residual" in name else 1.0)
            if module.bias is not None:
                nn.init.zeros_(module.bias)
