"""Networks of 64 x 64 images: critic, 2D generator, translators and an encoder of textures. [DDF22] app. genmodel.

Critic and generator are Mimicry's (Lee and Town 2020), which the paper cites, without spectral normalisation. A
shortcut's 1 x 1 convolution commutes with averaging and with interpolation: it is done on the smaller image, at a
quarter of the cost. f_T and g_T are CycleGAN's (Zhu et al. 2017, six residual blocks), h_T is ResNet-20 as made for
CIFAR (He et al. 2016, §4.2). Default widths are the paper's.

z_T at every pixel is a constant image of each channel. The first convolution, with its reflected border, makes a
constant of it, and the instance normalisation behind it takes every constant away: the paper's network, built as its
text says, cannot see z_T at all (shown in a test). So here z_T is at the pixels that see the object and 0 elsewhere, so
that it has an outline; all layers and parameters stay.

A transposed convolution of 3 x 3 with stride 2 gives pixels 1, 2 or 4 terms in turn, which short trainings show as a
grid of dots (Odena et al. 2016). With `upsampling: nearest` pixels are doubled and a convolution of the same kernel
follows: the same parameters, 9 terms at every pixel.
"""

import itertools
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

IMAGE_SIZE = 64
_SHARES = (1 / 16, 1 / 8, 1 / 4, 1 / 2, 1)  # of the width, from 32 x 32 pixels to 2 x 2 of the critic
SMALLEST = 4  # pixels a side of what the generator begins with
BLOCKS = 6  # of a translator
INITIAL_SPREAD = 0.02  # of all weights of a translator
Upsampling = Literal["transposed", "nearest"]


def _widths(width: int) -> list[int]:
    return [max(1, int(share * width)) for share in _SHARES]


class Critic(nn.Module):
    """D: logits of being real; five residual blocks that halve the image, sums over the last pixels, a linear layer."""

    def __init__(self, width: int = 1024) -> None:
        super().__init__()
        widths = _widths(width)
        self.first = _Down(3, widths[0], first=True)
        self.blocks = nn.Sequential(*(_Down(a, b) for a, b in itertools.pairwise(widths)))
        self.head = nn.Linear(widths[-1], 1)
        _initialise(self)

    def forward(self, images: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b"]:
        """Of images in [-1, 1]."""
        hidden = torch.relu(self.blocks(self.first(images)))
        return self.head(hidden.sum(dim=(-2, -1)))[:, 0]


class Generator2D(nn.Module):
    """Noise to colours in [-1, 1], without any shape: the image GAN that [DDF22] compares with."""

    def __init__(self, width: int = 1024, noise_features: int = 128) -> None:
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


class _Down(nn.Module):
    """Features to features of half the size; an image, the first, is not cut at 0 and widened at once."""

    def __init__(self, inputs: int, outputs: int, first: bool = False) -> None:
        super().__init__()
        self.residual = nn.Sequential(
            *([] if first else [nn.ReLU()]),
            nn.Conv2d(inputs, outputs if first else inputs, 3, padding=1),
            nn.ReLU(inplace=True),
            nn.Conv2d(outputs if first else inputs, outputs, 3, padding=1),
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
            nn.Upsample(scale_factor=2, mode="bilinear", align_corners=False),
            nn.Conv2d(inputs, outputs, 3, padding=1),
            nn.BatchNorm2d(outputs),
            nn.ReLU(inplace=True),
            nn.Conv2d(outputs, outputs, 3, padding=1),
        )
        self.shortcut = nn.Sequential(
            nn.Conv2d(inputs, outputs, 1), nn.Upsample(scale_factor=2, mode="bilinear", align_corners=False)
        )

    def forward(self, images: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c2 h2 w2"]:
        return self.residual(images) + self.shortcut(images)


def _initialise(network: nn.Module) -> None:
    """Mimicry's: Xavier's bounds, twice the variance inside residuals; biases 0."""
    for name, module in network.named_modules():
        if isinstance(module, nn.Conv2d | nn.Linear):
            nn.init.xavier_uniform_(module.weight, 2**0.5 if "residual" in name else 1.0)
            if module.bias is not None:
                nn.init.zeros_(module.bias)


def _conv(inputs: int, outputs: int, size: int, stride: int = 1) -> nn.Sequential:
    border: list[nn.Module] = [nn.ReflectionPad2d(size // 2)] if stride == 1 else []
    return nn.Sequential(*border, nn.Conv2d(inputs, outputs, size, stride, 0 if border else size // 2))


def _doubled(inputs: int, outputs: int, upsampling: Upsampling) -> nn.Module:
    if upsampling == "transposed":
        return nn.ConvTranspose2d(inputs, outputs, 3, 2, 1, 1)
    return nn.Sequential(nn.Upsample(scale_factor=2), _conv(inputs, outputs, 3))


def _normalised(layer: nn.Module, outputs: int) -> nn.Sequential:
    return nn.Sequential(layer, nn.InstanceNorm2d(outputs), nn.ReLU(inplace=True))


class ResidualBlock(nn.Module):
    """x + two convolutions of x."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first = _normalised(_conv(width, width, 3), width)
        self.second = nn.Sequential(_conv(width, width, 3), nn.InstanceNorm2d(width))

    def forward(self, images: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c h w"]:
        """As large as the input."""
        return images + self.second(self.first(images))


class Translator(nn.Module):
    """CycleGAN's `resnet_6blocks`: normals and a texture to colours (f_T), or colours to normals (g_T), in [-1, 1].

    Instance normalisation has no parameters, so convolutions have biases.
    """

    def __init__(self, texture_features: int, width: int = 64, upsampling: Upsampling = "transposed") -> None:
        super().__init__()
        self.first = nn.Conv2d(3 + texture_features, width, 7)
        self.body = nn.Sequential(
            nn.InstanceNorm2d(width),
            nn.ReLU(inplace=True),
            _normalised(_conv(width, 2 * width, 3, stride=2), 2 * width),
            _normalised(_conv(2 * width, 4 * width, 3, stride=2), 4 * width),
            *(ResidualBlock(4 * width) for _ in range(BLOCKS)),
            _normalised(_doubled(4 * width, 2 * width, upsampling), 2 * width),
            _normalised(_doubled(2 * width, width, upsampling), width),
            _conv(width, 3, 7),
            nn.Tanh(),
        )
        for module in self.modules():
            if isinstance(module, nn.Conv2d | nn.ConvTranspose2d):
                nn.init.normal_(module.weight, 0.0, INITIAL_SPREAD)
                if module.bias is not None:
                    nn.init.zeros_(module.bias)

    def forward(
        self, images: Float[Tensor, "b 3 h w"], textures: Float[Tensor, "b z"] | None = None
    ) -> Float[Tensor, "b 3 h w"]:
        """Translated images.

        Args:
          images: in [-1, 1]; of normals, 0 where nothing is seen.
          textures: z_T, for f_T.
        """
        border = self.first.kernel_size[0] // 2
        hidden = functional.pad(images, (border,) * 4, mode="reflect")
        if textures is None:
            return self.body(self.first(hidden))
        where = hidden.ne(0).any(dim=1, keepdim=True).to(hidden)
        return self.body(self._first_with(hidden, where, textures))

    def _first_with(
        self, images: Float[Tensor, "b 3 h w"], where: Float[Tensor, "b 1 h w"], textures: Float[Tensor, "b z"]
    ) -> Float[Tensor, "b c h2 w2"]:
        """The first convolution of [images, z_T at the pixels `where`], with z_T folded into one kernel per image.

        Σ_j W_j * (z_j m) = (Σ_j z_j W_j) * m: 4 channels are convolved in place of 3 + dim(z_T) (derived here).
        """
        of_images, of_textures = self.first.weight[:, :3], self.first.weight[:, 3:]
        folded = torch.einsum("bj,ojhw->bohw", textures, of_textures)[:, :, None]
        kernels = torch.cat((of_images.expand(len(textures), -1, -1, -1, -1), folded), dim=2)
        joined = torch.cat((images, where), dim=1)
        found = functional.conv2d(joined.reshape(1, -1, *joined.shape[2:]), kernels.flatten(0, 1), groups=len(textures))
        assert self.first.bias is not None
        return found.reshape(len(textures), -1, *found.shape[2:]) + self.first.bias[:, None, None]


class TextureEncoder(nn.Module):
    """h_T: ResNet-20 as made for CIFAR, shortcuts without parameters; colours to an estimate of z_T."""

    def __init__(self, texture_features: int, width: int = 16) -> None:
        super().__init__()
        stages = [_TextureBlock(width, width, 1) for _ in range(3)]
        for inputs in (width, 2 * width):
            stages += [_TextureBlock(inputs, 2 * inputs, 2), *(_TextureBlock(2 * inputs, 2 * inputs, 1) for _ in "ab")]
        self.body = nn.Sequential(
            nn.Conv2d(3, width, 3, padding=1, bias=False), nn.BatchNorm2d(width), nn.ReLU(inplace=True), *stages
        )
        self.head = nn.Linear(4 * width, texture_features)
        for module in self.modules():
            if isinstance(module, nn.Conv2d | nn.Linear):
                nn.init.kaiming_normal_(module.weight)

    def features(self, images: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b features"]:
        """Pooled features of images in [-1, 1], before the linear layer."""
        return self.body(images).mean(dim=(-2, -1))

    def forward(self, images: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b z"]:
        """ẑ_T of images in [-1, 1]."""
        return self.head(self.features(images))


class _TextureBlock(nn.Module):
    """Two convolutions and a shortcut: every other pixel, and zeros for the new channels."""

    def __init__(self, inputs: int, outputs: int, stride: int) -> None:
        super().__init__()
        self.stride, self.added = stride, outputs - inputs
        self.residual = nn.Sequential(
            nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False),
            nn.BatchNorm2d(outputs),
            nn.ReLU(inplace=True),
            nn.Conv2d(outputs, outputs, 3, 1, 1, bias=False),
            nn.BatchNorm2d(outputs),
        )

    def forward(self, images: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c2 h2 w2"]:
        shortcut = images[:, :, :: self.stride, :: self.stride]
        before = self.added // 2
        padded = functional.pad(shortcut, (0, 0, 0, 0, before, self.added - before))
        return torch.relu(padded + self.residual(images))
