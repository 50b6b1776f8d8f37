"""Seconds of an optimisation step, found by making some: for trainings that have a time, not a number of steps."""

import copy
import dataclasses
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from torch import nn

from ddf import training

SHARE, MOST_STEPS = 0.03, 400  # of the budget that a trial takes, about; and its steps, at most
FIRST_TRIAL = 8  # steps, by which those of the longer one are chosen

Model = TypeVar("Model", bound=nn.Module)


def seconds_per_step(
    model: Model,
    groups: Callable[[Model], list[dict]],
    loss: Callable[[Model], training.StepLoss],
    loop: training.LoopConfig,
    budget_seconds: float,
) -> float:
    """Mean time of a step as `training.fit` makes them, on copies; the model stays as it is.

    Bare steps, without the loop around them, take up to 12 % less.

    Args:
      groups, loss: the optimiser's parameter groups and the loss of a step, of a copy.
    """

    def trial(steps: int) -> float:
        """Mean of the second half of so many steps, at least 2; in the first, memory is touched for the first time."""
        own, half = copy.deepcopy(model), steps // 2
        often = dataclasses.replace(loop, log_every=half)
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder)
            training.fit(own, groups(own), loss(own), 2 * half, often, out, {"fingerprint": ""}, "timing a step")
            first, last = (row["seconds"] for row in training.read_log(out))
        return (last - first) / half

    each = trial(FIRST_TRIAL)
    steps = min(MOST_STEPS, int(SHARE * budget_seconds / each))
    return trial(steps) if steps > FIRST_TRIAL else each
