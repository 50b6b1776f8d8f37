"""Rivals are trained by the library's loop; nothing of it is kept but the network."""

import contextlib
import tempfile
from pathlib import Path
from typing import TypeVar

from torch import nn

from ddf.models import loop_config
from ddf.training import training_loop

Network = TypeVar("Network", bound=nn.Module)


def trained(
    network: Network,
    loss: training_loop.StepLoss,
    steps: int,
    loop: loop_config.LoopConfig,
    describe: str,
    kept: Path | None = None,
) -> Network:
    """`network` after so many steps, in evaluation mode.

    Args:
      kept: folder of this very training, from whose last checkpoint it goes on.
    """
    groups = [{"params": list(network.parameters()), "weight_decay": 0.0}]
    with contextlib.nullcontext(kept) if kept else tempfile.TemporaryDirectory() as folder:
        training_loop.fit(network, groups, loss, steps, loop, Path(folder), {"fingerprint": ""}, describe)
    return network.eval()
