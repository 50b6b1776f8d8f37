"""One training on several processes, as `torchrun` starts them: each has a part of every batch, all have one model.

The processes draw the same random numbers and cut the batch of a step into equal parts. The mean over the batch is then
the mean of the parts' means, and so are loss and gradient. Batch statistics are taken over all parts: loss and
parameters are those of one process up to rounding. On CUDA every process has a GPU of its own (nccl), else they share
the CPU (gloo). Without torchrun nothing here does anything.
"""

import datetime
import functools
import logging
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import torch
import torch.distributed as group
from jaxtyping import Float
from torch import Tensor, nn
from torch.distributed.nn import functional
from torch.nn.modules import batchnorm

from ddf.core import checks

# torchrun ends all processes when one fails; until then, waiting for another that reads its data is no failure.
PATIENCE = datetime.timedelta(days=1)


def launched() -> int:
    """How many processes were started together; 1 without torchrun."""
    return int(os.environ.get("WORLD_SIZE", "1"))


def count() -> int:
    """How many processes share this training; 1 outside `shared`."""
    return group.get_world_size() if group.is_initialized() else 1


def rank() -> int:
    """The number of this process, from 0. The first one writes the files, the log and the progress bar, alone."""
    return group.get_rank() if group.is_initialized() else 0


def shared(run: Callable[..., None]) -> Callable[..., None]:
    """`run` as a work of all processes that torchrun started; `run` itself where there is one.

    All but the first process end with it: what follows, such as noting the stage's time, is done once.

    InputError where a process has no GPU of its own.
    """

    @functools.wraps(run)
    def joined(*arguments: Any) -> None:
        if launched() == 1:
            return run(*arguments)
        _join()
        number = rank()
        run(*arguments)
        group.destroy_process_group()
        return sys.exit() if number else None

    return joined


def _join() -> None:
    if torch.cuda.is_available():
        own, present = int(os.environ["LOCAL_RANK"]), torch.cuda.device_count()
        if own >= present:
            raise checks.InputError(f"every process needs a GPU of its own; process {own} of a machine with {present}")
        torch.cuda.set_device(own)
        group.init_process_group("nccl", timeout=PATIENCE, device_id=torch.device("cuda", own))
    else:
        group.init_process_group("gloo", timeout=PATIENCE)
    if rank():
        logging.getLogger().setLevel(logging.ERROR)  # the first process speaks for all


def part(size: int) -> slice:
    """Which of the `size` images of a step are this process's; InputError where they cannot be shared equally."""
    if size % count():
        raise checks.InputError(f"train.batch_size must be a multiple of the {count()} processes; got {size}")
    each = size // count()
    return slice(rank() * each, (rank() + 1) * each)


def average_gradients(parameters: Iterable[nn.Parameter]) -> None:
    """Replace every gradient by its mean over the processes, in one exchange."""
    if count() == 1:
        return
    gradients = [parameter.grad for parameter in parameters if parameter.grad is not None]
    joined = nn.utils.parameters_to_vector(gradients)
    group.all_reduce(joined)
    nn.utils.vector_to_parameters(joined / count(), gradients)


def means(values: Mapping[str, Float[Tensor, ""]]) -> Mapping[str, Float[Tensor, ""]]:
    """Each value's mean over the processes."""
    if count() == 1:
        return values
    joined = torch.stack(list(values.values()))
    group.all_reduce(joined)
    return dict(zip(values, (joined / count()).unbind(), strict=True))


def check_same(name: str, value: str) -> None:
    """Raise unless `value` is the same on all processes; every process raises InputError."""
    if count() == 1:
        return
    said = [""] * count()
    group.all_gather_object(said, value)
    if len(set(said)) > 1:
        raise checks.InputError(f"{name} differ between processes: all need the same files; process {rank()}: {value}")


def share_batch_statistics(model: nn.Module) -> None:
    """Let every batch normalisation of `model` use the whole batch of all processes; parameters and names stay."""
    if count() == 1:
        return
    if torch.cuda.is_available():
        nn.SyncBatchNorm.convert_sync_batchnorm(model)
        return
    for module in model.modules():
        if isinstance(module, batchnorm._BatchNorm):
            module.__class__ = _SharedBatchNorm  # torch's own knows GPUs only


class _SharedBatchNorm(batchnorm._BatchNorm):
    """Batch normalisation of equal parts on all processes: each normalises the whole batch and keeps its part."""

    def _check_input_dim(self, input: Tensor) -> None:
        """Any: channels are the second axis."""

    def forward(self, input: Float[Tensor, "b c *places"]) -> Float[Tensor, "b c *places"]:
        """As of the whole batch; the gradient is that of the sum of the processes' losses."""
        if not self.training:
            return super().forward(input)
        whole = torch.cat(functional.all_gather(input))
        return super().forward(whole)[part(len(whole))]
