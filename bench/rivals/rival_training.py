"""Rivals are trained by the library's loop; nothing of it is kept but the network."""

import tempfile
from pathlib import Path
from typing import TypeVar

from torch import nn

from ddf.training import training_loop

Network = TypeVar("Network", bound=nn.Module)


def groups(network: nn.Module) -> list[dict]:
    """All parameters, without weight decay."""
    return [{"params": list(network.parameters()), "weight_decay": 0.0}]


def trained(
    network: Network, loss: training_loop.StepLoss, steps: int, loop: training_loop.LoopConfig, describe: str
) -> Network:
    """`network` after so many steps, in evaluation mode."""
    with tempfile.TemporaryDirectory() as folder:
        training_loop.fit(network, groups(network), loss, steps, loop, Path(folder), {"fingerprint": ""}, describe)
    return network.eval()
