"""The types of oriented-point samples, once: what each supervises, in the order in which a batch holds them.

A term of the loss reads one slice of a batch, so the types of a term stand side by side in `TYPES`. A new type is an
entry here and a function in `draws`.
"""

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ddf.core import checks
from ddf.data.samples import draws


@dataclass(frozen=True)
class SampleType:
    """One type of samples and the terms of the loss that cover it.

    draw: with its ground truth by the stage `samples`; None of points that are not stored. derivatives: not of points
    that depth and visibility alone supervise. values: may also come so, as `U+` of `U`, for less than half the cost.
    eikonal, normals, transition: covered by these terms. doubled: its depth counts twice. needed: every batch has some.
    """

    name: str
    draw: Callable[[draws.Domain, int, np.random.Generator], draws.Draw] | None = None
    derivatives: bool = True
    values: bool = False
    eikonal: bool = False
    normals: bool = False
    transition: bool = False
    doubled: bool = False
    needed: bool = True


TYPES = (
    SampleType("E", eikonal=True),  # extra uniform points, without ground truth
    SampleType("U", draws.draw_uniform, values=True, eikonal=True, normals=True, doubled=True),
    SampleType("A", draws.draw_at_surface, values=True, eikonal=True, normals=True, doubled=True),
    SampleType("B", draws.draw_bounding, values=True, eikonal=True, normals=True),
    SampleType("S", draws.draw_surface, values=True, transition=True),
    SampleType("T", draws.draw_tangent, values=True, transition=True),
    SampleType("O", draws.draw_offset),  # has no derivatives anyway
    SampleType("P", derivatives=False, doubled=True, needed=False),  # rays that the field proposes itself
)


def base(name: str) -> str:
    """The sample type of an entry of `STORED`: U+ are U samples, of which no derivative is read."""
    return name.removesuffix("+")


def _named(of: Callable[[SampleType], bool]) -> tuple[str, ...]:
    return tuple(kind.name for kind in TYPES if of(kind))


DRAWS = {kind.name: kind.draw for kind in TYPES if kind.draw is not None}
KINDS = tuple(DRAWS)  # what a shard holds
ORDER = _named(lambda kind: kind.derivatives)
STORED_VALUES = tuple(f"{name}+" for name in _named(lambda kind: kind.values))
VALUES_ONLY = (*STORED_VALUES, *_named(lambda kind: not kind.derivatives))
STORED = (*KINDS, *STORED_VALUES)
BATCH = (*ORDER, *VALUES_ONLY)
NEEDED = _named(lambda kind: kind.needed)
LEFT_OUT = 10_000  # samples of a stored type of which a config says nothing

Span = tuple[str, str]  # first and last type of a slice of a batch


def runs(names: tuple[str, ...]) -> tuple[Span, ...]:
    """The slices of a batch that hold these types, and these with +."""
    found = []
    for inside, group in itertools.groupby(BATCH, lambda name: base(name) in names):
        members = list(group)
        if inside:
            found.append((members[0], members[-1]))
    return tuple(found)


def _span(of: Callable[[SampleType], bool]) -> Span:
    """The one slice of the points with derivatives that a term covers."""
    places = [ORDER.index(name) for name in _named(of)]
    assert places == list(range(places[0], places[-1] + 1)), "types of one term must stand side by side in TYPES"
    return ORDER[places[0]], ORDER[places[-1]]


EIKONAL = _span(lambda kind: kind.eikonal)
NORMALS = _span(lambda kind: kind.normals)
TRANSITION = _span(lambda kind: kind.transition)
GROUND_TRUTH = (KINDS[0], BATCH[-1])
DOUBLED_DEPTH = runs(_named(lambda kind: kind.doubled))


def each(count: int) -> dict[str, int]:
    """So many samples of every stored type."""
    return dict.fromkeys(KINDS, count)


def scaled(counts: Mapping[str, int], share: int | float) -> dict[str, int]:
    """A share of the samples of each stored type, and one of each at the least."""
    return {kind: max(1, round(counts[kind] * share)) for kind in KINDS}


def stored(name: str, counts: Mapping[str, int]) -> dict[str, int]:
    """Samples of each stored type in order; `LEFT_OUT` of one that is not given. InputError, with the config's key
    `name`, where a type is unknown or without samples.
    """
    if not set(counts) <= set(KINDS) or min(counts.values(), default=1) < 1:
        raise checks.InputError(f"{name} may give each of {', '.join(KINDS)} >= 1; got {dict(counts)}")
    return {kind: counts.get(kind, LEFT_OUT) for kind in KINDS}


def check_counts(name: str, counts: Mapping[str, int]) -> None:
    """Raise unless the points per type of a step have every needed type, and perhaps some of the others; `name` is the
    config's key.
    """
    may = [kind for kind in (*ORDER, *STORED_VALUES) if kind not in NEEDED]
    if not set(NEEDED) <= set(counts) <= {*NEEDED, *may} or min(counts.values()) < 1:
        raise checks.InputError(
            f"{name} must give each of {', '.join(NEEDED)} >= 1, may give {', '.join(may)} >= 1; got {counts}"
        )
