"""How many steps of a training fit into some seconds of one core, however busy the machine is."""

import time
from collections.abc import Callable

FEW, MORE = 5, 45  # steps of two short trainings


def steps_within(train: Callable[[int], object], seconds: float) -> int:
    """Steps for which `train` takes so many seconds of this process's time, what it does before them included."""
    train(FEW)  # the first one loads libraries and touches memory
    few, more = _seconds(train, FEW), _seconds(train, MORE)
    each = (more - few) / (MORE - FEW)
    if each <= 0:
        raise RuntimeError(f"{MORE} steps took {more:.3g} s, {FEW} took {few:.3g} s: too few to tell what one takes")
    return max(1, int((seconds - few) / each) + FEW)


def _seconds(train: Callable[[int], object], steps: int) -> float:
    started = time.process_time()
    train(steps)
    return time.process_time() - started
