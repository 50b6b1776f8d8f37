"""What a GPU would be asked for, counted without one: operators, waits for values, copies, bytes and products.

The device is torch's `meta`, whose tensors have a shape and a type and no values: the code runs as on a GPU, and every
operator that it dispatches is counted. Where a value is asked for, which a GPU would be waited for, 1 stands for it.
"""

import contextlib
import dataclasses
import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any
from unittest import mock

import torch
from torch import Tensor
from torch.utils import _pytree as pytree
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils.flop_counter import FlopCounterMode

from bench.gpu import parity, sizes
from ddf.data.batches import resident
from ddf.fields import cloud_projection, pddf
from ddf.fields.gpu import farthest_points
from ddf.geometry.gpu import meshes
from ddf.models.reconstruction import settings
from ddf_lab.engine import step_cost

DEVICE = "meta"
READS = ("_local_scalar_dense", "item", "is_nonzero", "equal")  # of a value
SIZES = ("nonzero", "masked_select")  # whose result has a size that the values tell
EVENLY = {"jitter": 0.2, "recheck": (0.1,), "spread": 0.75, "crowding": 1.0, "least_confidence": 0.1, "aimed": 0.5}
FREE = ("empty", "new_empty", "detach", "_unsafe_view")  # launch nothing


@dataclass
class Counts:
    """launches: operators on the device that are no views; fused ones of the optimiser count once. waits: for values,
    by operator. sent, fetched: copies to the device and from it. bytes: that its operators read and write. flops: of
    products. names: launches by operator.
    """

    launches: int = 0
    waits: dict[str, int] = field(default_factory=dict)
    sent: int = 0
    fetched: int = 0
    bytes: int = 0
    flops: int = 0
    names: dict[str, int] = field(default_factory=dict)


class Counter(TorchDispatchMode):
    """Adds what is dispatched while it lasts to `counts`."""

    def __init__(self) -> None:
        super().__init__()
        self.counts = Counts()

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        """Run one operator, and count it."""
        kwargs, name = kwargs or {}, func._schema.name.removeprefix("aten::")
        given = [value for value in pytree.tree_leaves((args, kwargs)) if isinstance(value, Tensor)]
        if any(value.is_meta for value in given):
            if name in READS:
                self._wait(name)
                return 1.0 if given[0].dtype.is_floating_point else True
            if name in SIZES:
                self._wait(name)
                return _as_if_all(name, given[0])
            if name.startswith("index") and any(value.dtype == torch.bool for value in given[1:]):
                self._wait(f"{name} by a mask")
                args, kwargs = pytree.tree_map(_rows_of_mask, (args, kwargs))
        fetched = name == "_to_copy" and given[0].is_meta and kwargs.get("device", given[0].device).type == "cpu"
        if fetched:
            self.counts.fetched += 1
            return torch.zeros(given[0].shape, dtype=kwargs.get("dtype") or given[0].dtype)
        if name == "copy_" and given[1].is_meta and not given[0].is_meta:
            self.counts.fetched += 1
            return given[0]
        found = func(*args, **kwargs)
        self._count(name, func, given, [each for each in pytree.tree_leaves(found) if isinstance(each, Tensor)])
        return found

    def _wait(self, name: str) -> None:
        self.counts.waits[name] = self.counts.waits.get(name, 0) + 1

    def _count(self, name: str, func: Any, given: list[Tensor], results: list[Tensor]) -> None:
        touched = [value for value in (*given, *results) if value.is_meta]
        if not touched or name.startswith(FREE) or _is_view(func):
            return
        if name in ("_to_copy", "copy_") and not given[-1].is_meta:
            self.counts.sent += 1
            return
        self.counts.launches += 1
        self.counts.names[name] = self.counts.names.get(name, 0) + 1
        self.counts.bytes += sum(value.numel() * value.element_size() for value in touched)


def _is_view(func: Any) -> bool:
    returns = [each.alias_info for each in func._schema.returns]
    return bool(returns) and all(each is not None and not each.is_write for each in returns)


def _as_if_all(name: str, value: Tensor) -> Tensor:
    """Every value counts."""
    if name == "nonzero":
        return torch.zeros((value.numel(), value.ndim), dtype=torch.int64, device=value.device)
    return value.flatten().clone()


def _rows_of_mask(value: Any) -> Any:
    if isinstance(value, Tensor) and value.dtype == torch.bool:
        return torch.zeros(value.numel(), dtype=torch.int64, device=value.device)
    return value


@contextlib.contextmanager
def faked(resident_data: bool = True) -> Iterator[None]:
    """While this lasts, the package works on `DEVICE`, for which the CPU's generators serve."""

    def drawn(draw: Callable[..., Tensor]) -> Callable[..., Tensor]:
        return lambda *size, generator=None, **named: draw(*size, **named)

    with contextlib.ExitStack() as stack:
        stack.enter_context(parity.placed(DEVICE))
        stack.enter_context(mock.patch.object(resident, "room", lambda _: resident_data << 40))
        stack.enter_context(mock.patch.object(meshes, "refusal", lambda _: None))
        stack.enter_context(mock.patch.object(meshes, "_kernel", _no_hits))
        for name in ("rand", "randn"):
            stack.enter_context(mock.patch.object(torch, name, drawn(getattr(torch, name))))
        yield


def _no_hits(corners: Tensor, ranges: Tensor, rays: Tensor) -> tuple[Tensor, Tensor]:
    """As many operators as the kernel that casts rays comes with, without itself."""
    size = rays.shape[1:]
    return torch.zeros(size, device=DEVICE), torch.zeros(size, dtype=torch.int32, device=DEVICE)


def count(work: Callable[[], object]) -> Counts:
    """What one call asks for, inside `faked`: the second call, for the first one prepares."""
    with Counter():
        work()
    with FlopCounterMode(display=False) as flops, Counter() as counter:
        work()
    counter.counts.flops = flops.get_total_flops()
    return counter.counts


def rows(how: sizes.Sizes) -> list[dict[str, Any]]:
    """A row per model, of a step with plain passes; of a step whose data come from the host; of a cloud."""
    found = []
    for name, section in how.sections.items():
        for place in ("the device", "the host"):
            counted = step_counts(how.train, section, place == "the device")
            found.append(_row(f"{name} step, data on {place}", counted))
    return [*found, casting_row(how), cloud_row(how)]


def casting_row(how: sizes.Sizes) -> dict[str, Any]:
    """Of a step whose samples are fresh and whose field proposes rays, all of them cast on the device."""
    section = dataclasses.replace(how.ddf, samples="fresh", proposals=how.proposals)
    return _row("ddf step, fresh samples and proposals", step_counts(how.train, section))


def cloud_row(how: sizes.Sizes) -> dict[str, Any]:
    """Of a cloud in farthest-point order, which counts as one operator."""
    spread = dataclasses.replace(how.cloud, **EVENLY)
    with faked(), torch.device(DEVICE):
        field = pddf.PDDF(how.ddf.field.of(how.train.decoder))

    def order(points: Tensor, count: int, weights: Tensor) -> Tensor:
        return torch.zeros(count, dtype=torch.int64, device=DEVICE)

    def draw() -> None:
        cycles = cloud_projection.sample(field, None, how.cloud_points, spread, torch.Generator())
        cloud_projection.select(cycles, [how.cloud_points], spread)

    with faked(), mock.patch.object(farthest_points, "farthest_point_order", order):
        return _row(f"cloud of {how.cloud_points:,} points", count(draw))


def _row(what: str, counted: Counts) -> dict[str, Any]:
    told = {name: value for name, value in dataclasses.asdict(counted).items() if name != "names"}
    return {"what": what, **told, "waits": sum(counted.waits.values())}


def step_counts(train: settings.TrainConfig, section: step_cost.Section, resident_data: bool = True) -> Counts:
    """Of one step on random data: batch, loss, gradients and Muon; AdamW, which torch fuses, is not counted."""
    with faked(resident_data), mock.patch.object(torch.optim.AdamW, "step"):
        with Counter():
            trial = step_cost.trial(train, section)
        numbers = itertools.count()

        def step() -> None:
            trial.backward(next(numbers))
            trial.optimiser.step()

        return count(step)
