"""The passes of a block and the loss between them as few kernels, by torch's compiler: on a GPU.

There each operator of the passes is a kernel that reads and writes all of its values, which takes longer than the
matrix products between them. The compiler joins what lies between two products. A CPU's blocks stay in its cache.
"""

import functools
import logging
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from ddf.data.samples import sample_batch
from ddf.fields import passes
from ddf.fields.pddf import PDDF

LOGGER = logging.getLogger(__name__)
MOST_FORMS = 64  # of models, sizes and types in one process, for each of which passes are compiled anew

BlockLoss = Callable[..., tuple[Tensor, list[Tensor]]]
_refused: list[str] = []  # why this machine does not compile


def wanted(device: torch.device) -> bool:
    """Whether passes on this device are compiled."""
    return device.type == "cuda" and not _refused


def block_loss(
    plain: BlockLoss,
    field: PDDF,
    block: sample_batch.SampleBatch,
    modulations: list[Tensor] | None,
    weights: Any,
    parameters: passes.Parameters,
    numbers: Mapping[Any, int],
    differentiate: bool,
) -> tuple[Tensor, list[Tensor]]:
    """What `plain` gives, and adds to the sums of `parameters`, up to rounding; by `plain` where nothing compiles."""
    given = (field, block.tensors(), dict(block.counts), modulations, weights, parameters.product, dict(numbers))
    made = _unless_refused(_compiled(plain), *given)
    if made is None:
        return plain(field, block, modulations, weights, parameters, numbers, differentiate)
    values, found, sums = made
    for total, own in zip(parameters.sums(), sums, strict=True):
        total += own
    return values, found


def raw(
    field: PDDF, positions: Tensor, directions: Tensor, modulations: Sequence[Tensor] | None
) -> Float[Tensor, "*batch out"]:
    """`field` of these arguments; where a training compiles, by few kernels, and so its gradient."""
    if not (field.training and torch.is_grad_enabled() and wanted(positions.device)):
        return field(positions, directions, modulations)
    found = _unless_refused(_compiled_field(), field, positions, directions, modulations)
    return field(positions, directions, modulations) if found is None else found


def _unless_refused(compiled: Callable[..., Any], *given: Any) -> Any:
    """What a compiled function gives; None, and a warning, where this machine does not compile it."""
    from torch._dynamo import config, exc  # takes a second, for a GPU alone

    try:
        with config.patch(recompile_limit=MOST_FORMS):
            return compiled(*given)
    except exc.TorchDynamoException as error:
        _refused.append(str(error))
        LOGGER.warning("the loss is not compiled, so steps take longer: %s", " ".join(str(error).split())[:200])
        return None


@functools.cache
def _compiled_field() -> Callable[..., Tensor]:
    return torch.compile(lambda field, *given: field(*given), fullgraph=True, dynamic=False)


@functools.cache
def _compiled(plain: BlockLoss) -> Callable[..., tuple[Tensor, list[Tensor], list[Tensor]]]:
    """A function of tensors alone, which keeps nothing."""

    def lone(
        field: PDDF,
        tensors: tuple[Tensor, ...],
        counts: dict[str, int],
        modulations: list[Tensor] | None,
        weights: Any,
        product: torch.dtype,
        numbers: dict[Any, int],
    ) -> tuple[Tensor, list[Tensor], list[Tensor]]:
        parameters = passes.Parameters(field.network, product, passes.FreshMemory)
        block = sample_batch.SampleBatch(*tensors, counts=counts)
        values, found = plain(field, block, modulations, weights, parameters, numbers, True)
        return values, found, parameters.sums()

    return torch.compile(lone, fullgraph=True, dynamic=False)
