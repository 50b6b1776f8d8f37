"""Seconds of an optimisation step, found by making some: for trainings that have a time, not a number of steps."""

import copy
import dataclasses
import statistics
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from torch import nn

from ddf.training import training_loop

SHARE, MOST_STEPS = 0.03, 400  # of the budget that a trial takes, about; and its steps, at most
FIRST_TRIAL = 8  # steps, by which those of the longer one are chosen
TURNS = 5  # trials of each of two trainings that are compared

Model = TypeVar("Model", bound=nn.Module)


@dataclass(frozen=True)
class Trainee(Generic[Model]):
    """What `training_loop.fit` takes. groups, loss: of a copy, the optimiser's parameter groups and a step's loss."""

    model: Model
    groups: Callable[[Model], list[dict]]
    loss: Callable[[Model], training_loop.StepLoss]
    loop: training_loop.LoopConfig

    def trial(self, steps: int) -> float:
        """Mean seconds of the second half of so many steps, at least 2, as `training_loop.fit` makes them, on a copy.

        In the first half memory is touched for the first time. Bare steps, without the loop around them, take up to
        12 % less.
        """
        own, half = copy.deepcopy(self.model), steps // 2
        often = dataclasses.replace(self.loop, log_every=half)
        with tempfile.TemporaryDirectory() as folder:
            out, record = Path(folder), {"fingerprint": ""}
            training_loop.fit(own, self.groups(own), self.loss(own), 2 * half, often, out, record, "timing a step")
            first, last = (row["seconds"] for row in training_loop.read_log(out))
        return (last - first) / half


def seconds_per_step(trainee: Trainee, budget_seconds: float) -> float:
    """Mean time of a step, by a trial that takes `SHARE` of the budget."""
    each = trainee.trial(FIRST_TRIAL)
    steps = min(MOST_STEPS, int(SHARE * budget_seconds / each))
    return trainee.trial(steps) if steps > FIRST_TRIAL else each


def times_as_long(one: Trainee, other: Trainee) -> float:
    """A step of `one` as a multiple of one of `other`: the median over trials of both in turn, so that a busy moment
    meets both.
    """
    return statistics.median(one.trial(FIRST_TRIAL) / other.trial(FIRST_TRIAL) for _ in range(TURNS))
