"""The encoders that `train.encoder` can name."""

from collections.abc import Callable

from ddf.core import checks
from ddf.models.encoders import convnext, encoder, resnet

ENCODERS: dict[str, Callable[[int, int], encoder.Encoder]] = {  # a new one is an entry here and a file beside
    "resnet": resnet.ResNet18,
    "convnext": convnext.ConvNeXt,
}


def require(name: str) -> None:
    """Raise InputError unless there is an encoder of that name."""
    if name not in ENCODERS:
        raise checks.InputError(f"train.encoder must be one of {', '.join(ENCODERS)}; got {name!r}")
