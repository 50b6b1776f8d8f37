"""A batch of oriented points with their ground truth, type after type, so that a term of the loss reads one slice."""

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from ddf.core import arrays
from ddf.data.samples import sample_types


@dataclass(frozen=True)
class SampleBatch:
    """Oriented points of several shapes in the order of `sample_types.BATCH`, with their ground truth.

    counts: points per type and shape, none of a type that is absent. The ground truth has entries for E too (never
    read), so that one index fits all. depth: never read on a miss. normals: at the hit for U A B, at q_0 for
    S T.
    """

    positions: Float[Tensor, "shapes n 3"]
    directions: Float[Tensor, "shapes n 3"]
    visible: Float[Tensor, "shapes n"]
    depth: Float[Tensor, "shapes n"]
    normals: Float[Tensor, "shapes n 3"]
    counts: Mapping[str, int]

    def to(self, device: torch.device) -> "SampleBatch":
        """The same batch on another device."""
        return SampleBatch(*(arrays.send(tensor, device) for tensor in self.tensors()), counts=self.counts)

    def followed_by(self, other: "SampleBatch") -> "SampleBatch":
        """This batch with the points of another one, of later types of the same shapes, behind its own."""
        pairs = zip(self.tensors(), other.tensors(), strict=True)
        return SampleBatch(*(torch.cat(pair, dim=1) for pair in pairs), counts={**self.counts, **other.counts})

    def span(self, first: str, last: str) -> slice:
        """The points from type `first` to type `last`, both included."""
        order = sample_types.BATCH
        before = sum(self.counts.get(name, 0) for name in order[: order.index(first)])
        through = sum(self.counts.get(name, 0) for name in order[: order.index(last) + 1])
        return slice(before, through)

    def number(self, first: str, last: str) -> int:
        """How many points of all shapes `span` covers; at least 1, so that it can be divided by."""
        span = self.span(first, last)
        return max(1, len(self.positions) * (span.stop - span.start))

    def blocks(self, points: int) -> Iterator[tuple[slice, "SampleBatch"]]:
        """The same in parts of about `points` points, each a batch in the same order: whole shapes, or parts of one.

        Yields the shapes of each part with it.
        """
        shapes, count = self.visible.shape
        together, parts = max(1, points // count), math.ceil(count / points)
        edges = [round(count * part / parts) for part in range(parts + 1)]
        for first in range(0, shapes, together):
            chosen = slice(first, min(first + together, shapes))
            for rows in itertools.starmap(slice, itertools.pairwise(edges)):
                yield chosen, self._part(chosen, rows)

    def _part(self, shapes: slice, rows: slice) -> "SampleBatch":
        spans = {name: self.span(name, name) for name in self.counts}
        counts = {name: max(0, min(span.stop, rows.stop) - max(span.start, rows.start)) for name, span in spans.items()}
        return SampleBatch(*(tensor[shapes, rows] for tensor in self.tensors()), counts=counts)

    def tensors(self) -> tuple[Tensor, ...]:
        """In the order in which they are given."""
        return self.positions, self.directions, self.visible, self.depth, self.normals
