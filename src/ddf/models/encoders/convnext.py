"""ConvNeXt V2 with a chosen first width. Source: Woo et al. 2023; depths of the smallest, "atto", whose width is 40."""

import itertools

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ddf.models.encoders.encoder import IMAGE_CHANNELS, Encoder

DEPTHS = (2, 2, 6, 2)
_EPSILON = 1e-6


class ConvNeXt(Encoder):
    """Patches of 4 x 4 pixels, then four stages, each half as wide and high and of twice as many channels."""

    def __init__(self, out_features: int, width: int) -> None:
        super().__init__()
        widths = [width * 2**stage for stage in range(len(DEPTHS))]
        stem = nn.Sequential(nn.Conv2d(IMAGE_CHANNELS, width, kernel_size=4, stride=4), ChannelNorm(width))
        down = [
            nn.Sequential(ChannelNorm(a), nn.Conv2d(a, b, kernel_size=2, stride=2))
            for a, b in itertools.pairwise(widths)
        ]
        stages = zip([stem, *down], widths, DEPTHS, strict=True)
        self.parts = nn.ModuleList(
            nn.Sequential(start, *(Block(w) for _ in range(depth))) for start, w, depth in stages
        )
        self.norm = nn.LayerNorm(widths[-1], eps=_EPSILON)
        self.fc = nn.Linear(widths[-1], out_features)
        for module in self.modules():
            if isinstance(module, nn.Conv2d | nn.Linear):
                nn.init.trunc_normal_(module.weight, std=0.02)
                module.bias = nn.Parameter(torch.zeros(len(module.weight)))

    def stages(self, images: Float[Tensor, "b 4 h w"]) -> tuple[Float[Tensor, "b half"], Float[Tensor, "b features"]]:
        """Pooled features of the last two stages."""
        found = [images]
        for part in self.parts:
            found.append(part(found[-1]))
        third, last = (hidden.mean(dim=(-2, -1)) for hidden in found[-2:])
        return third, self.norm(last)


class ChannelNorm(nn.LayerNorm):
    """Layer norm over the channels of each pixel."""

    def __init__(self, channels: int) -> None:
        super().__init__(channels, eps=_EPSILON)

    def forward(self, input: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c h w"]:
        """Same shape."""
        return super().forward(input.permute(0, 2, 3, 1)).permute(0, 3, 1, 2)


class Block(nn.Module):
    """x + W_2 grn(gelu(W_1 norm(depthwise 7 x 7))): W are 1 x 1 convolutions, four times as wide in between."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.depthwise = nn.Conv2d(width, width, kernel_size=7, padding=3, groups=width)
        self.norm = ChannelNorm(width)
        self.wider = nn.Conv2d(width, 4 * width, kernel_size=1)
        self.narrower = nn.Conv2d(4 * width, width, kernel_size=1)
        self.gain, self.offset = (nn.Parameter(torch.zeros(4 * width, 1, 1)) for _ in range(2))

    def forward(self, images: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c h w"]:
        """Same shape."""
        hidden = nn.functional.gelu(self.wider(self.norm(self.depthwise(images))))
        size = torch.linalg.vector_norm(hidden, dim=(-2, -1), keepdim=True)  # global response normalisation
        share = size / (size.mean(dim=1, keepdim=True) + _EPSILON)
        return images + self.narrower(hidden + self.gain * hidden * share + self.offset)
