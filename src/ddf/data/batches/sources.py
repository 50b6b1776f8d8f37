"""What a training draws from, wherever that lies: on disk, cast on the host, on a device."""

from collections.abc import Mapping
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Int

from ddf.data.batches import category_data
from ddf.data.samples import sample_batch

Value = TypeVar("Value", covariant=True)


@runtime_checkable
class SampleSource(Protocol):
    """Gives the oriented points of a batch with their ground truth."""

    def draw(
        self,
        shapes: Int[np.ndarray, "b"],
        counts: Mapping[str, int],
        random: np.random.Generator,
        part: slice,
        /,
    ) -> sample_batch.SampleBatch:
        """Points of every type for each of `part` of the shapes, drawn for all of them; E points have no truth."""
        ...


@runtime_checkable
class Listed(category_data.Numbered[Value], Protocol[Value]):
    """What is asked for by its number, of which there are so many."""

    def __len__(self) -> int: ...
