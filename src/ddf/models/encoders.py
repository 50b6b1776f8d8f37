"""Encoders of images: what one must have, ResNet-18, and the list that `train.encoder` names them by."""

from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor, nn

IMAGE_CHANNELS = 4
FULL_WIDTH = 64


class Encoder(nn.Module):
    """RGBA images in [0, 1] to a latent or to camera scores.

    A kind of encoder is made with (out_features, width) and has `stages` and `fc`, the linear layer at the end.
    """

    fc: nn.Linear

    def stages(self, images: Float[Tensor, "b 4 h w"]) -> tuple[Float[Tensor, "b _"], ...]:
        """Pooled features of one stage or more; `fc` takes the last, all tell whether an image is a strange one."""
        raise NotImplementedError

    def forward(self, images: Float[Tensor, "b 4 h w"]) -> Float[Tensor, "b out"]:
        """Latent or camera scores of each image."""
        return self.fc(self.stages(images)[-1])


class ResNet18(Encoder):
    """ResNet-18 on RGBA images with a chosen first width; 64 is torchvision's own network, not pretrained.

    Source: He et al. 2016; [DDF22] app. E.
    """

    def __init__(self, out_features: int, width: int = FULL_WIDTH) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(IMAGE_CHANNELS, width, kernel_size=7, stride=2, padding=3, bias=False)
        self.bn1 = nn.BatchNorm2d(width)
        self.relu = nn.ReLU(inplace=True)
        self.maxpool = nn.MaxPool2d(kernel_size=3, stride=2, padding=1)
        self.layer1 = _stage(width, width, stride=1)
        self.layer2 = _stage(width, 2 * width, stride=2)
        self.layer3 = _stage(2 * width, 4 * width, stride=2)
        self.layer4 = _stage(4 * width, 8 * width, stride=2)
        self.fc = nn.Linear(8 * width, out_features)
        for module in self.modules():
            # random numbers of the meta device load torch's compiler, seconds
            if isinstance(module, nn.Conv2d) and not module.weight.is_meta:
                nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")

    def stages(self, images: Float[Tensor, "b 4 h w"]) -> tuple[Float[Tensor, "b half"], Float[Tensor, "b features"]]:
        """Pooled features of the last two stages."""
        if images.is_cuda:  # convolutions of a GPU take channels side by side; oneDNN's have failed on small images so
            images = images.contiguous(memory_format=torch.channels_last)
        hidden = self.maxpool(self.relu(self.bn1(self.conv1(images))))
        third = self.layer3(self.layer2(self.layer1(hidden)))
        return third.mean(dim=(-2, -1)), self.layer4(third).mean(dim=(-2, -1))


class BasicBlock(nn.Module):
    """Two convolutions around which the input is added; weights as torchvision's block of that name has them.

    Its own, for `import torchvision` takes as long as all the rest of `ddf reconstruct` takes to start. Source: He et
    al. 2016.
    """

    def __init__(self, inputs: int, outputs: int, stride: int, downsample: nn.Module | None) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(inputs, outputs, kernel_size=3, stride=stride, padding=1, bias=False)
        self.bn1 = nn.BatchNorm2d(outputs)
        self.relu = nn.ReLU(inplace=True)
        self.conv2 = nn.Conv2d(outputs, outputs, kernel_size=3, padding=1, bias=False)
        self.bn2 = nn.BatchNorm2d(outputs)
        self.downsample = downsample

    def forward(self, images: Float[Tensor, "b inputs h w"]) -> Float[Tensor, "b outputs h2 w2"]:
        """Half as wide and high with a stride of 2."""
        added = images if self.downsample is None else self.downsample(images)
        hidden = self.relu(self.bn1(self.conv1(images)))
        return self.relu(self.bn2(self.conv2(hidden)) + added)


def _stage(inputs: int, outputs: int, stride: int) -> nn.Sequential:
    downsample = None
    if stride != 1 or inputs != outputs:
        downsample = nn.Sequential(
            nn.Conv2d(inputs, outputs, kernel_size=1, stride=stride, bias=False), nn.BatchNorm2d(outputs)
        )
    first = BasicBlock(inputs, outputs, stride, downsample)
    return nn.Sequential(first, BasicBlock(outputs, outputs, 1, None))


ENCODERS: dict[str, Callable[[int, int], Encoder]] = {"resnet": ResNet18}  # a new one is a class and its entry here
