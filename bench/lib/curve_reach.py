"""How much sooner one curve of errors against seconds gets down to an error than another; nothing is extrapolated."""

from collections.abc import Sequence
from dataclasses import dataclass

Curve = Sequence[tuple[float, float]]  # (seconds, error) in the order of time


@dataclass(frozen=True)
class Reach:
    """Seconds that both need to `level`, the smallest error that both have reached.

    times: theirs / ours. goal: our smallest error. bound: they never reached it, and `their_goal_seconds` is all their
    time, less than they would need.
    """

    level: float
    our_seconds: float
    their_seconds: float
    times: float
    goal: float
    goal_seconds: float
    their_goal_seconds: float
    bound: bool


def first_at(curve: Curve, error: float) -> float | None:
    """Seconds of the first point whose error is at most this one; None where none is."""
    return next((seconds for seconds, value in curve if value <= error), None)


def compare(ours: Curve, theirs: Curve) -> Reach:
    """How long each takes to the larger of the two smallest errors, and to our smallest.

    Only measured points count: between two of them the later one is taken, for both curves.

    Raises:
      ValueError: a curve is empty.
    """
    if not ours or not theirs:
        raise ValueError(f"both curves need a point; got {len(ours)} and {len(theirs)}")
    goal, least = (min(error for _, error in curve) for curve in (ours, theirs))
    level = max(goal, least)
    seconds, their_seconds = first_at(ours, level), first_at(theirs, level)
    goal_seconds, their_goal = first_at(ours, goal), first_at(theirs, goal)
    assert seconds and their_seconds and goal_seconds  # each curve reaches its own smallest error
    return Reach(
        level, seconds, their_seconds, their_seconds / seconds,
        goal, goal_seconds, theirs[-1][0] if their_goal is None else their_goal, their_goal is None,
    )  # fmt: skip
