"""Comparison of arrays for all tests, with tolerances by type; interrupted steps; and damage to a file."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch

TOLERANCES = {"float16": (2e-3, 5e-3), "float32": (1e-5, 1e-4), "float64": (1e-10, 1e-9)}  # absolute and relative


def assert_close(actual: Any, expected: Any, *, atol: Any = None, rtol: float | None = None) -> None:
    """Raise unless |actual - expected| <= atol + rtol |expected| everywhere, shapes being equal.

    Tolerances default to those of the coarser type of the two; equal infinities agree, NaN never does.

    Args:
      atol: one, or one for each entry.
    """
    names = [str(each.dtype).removeprefix("torch.") for each in (actual, expected) if hasattr(each, "dtype")]
    known = [TOLERANCES[name] for name in TOLERANCES if name in names] or [(0.0, 0.0)]
    usual = known[0] if names else TOLERANCES["float64"]
    left, right = _as_float64(actual), _as_float64(expected)
    assert left.shape == right.shape
    near = np.isclose(left, right, usual[1] if rtol is None else rtol, usual[0] if atol is None else atol)
    off = np.argwhere(~near)
    assert len(off) == 0, f"{len(off)} of {left.size} differ: {left[~near][0]} for {right[~near][0]} at {off[0]}"


def _as_float64(value: Any) -> np.ndarray:
    if isinstance(value, torch.Tensor):
        value = value.detach().cpu().double().numpy()
    return np.asarray(value, dtype=np.float64)


def stopped(step_loss: Callable[[int], Any], at: int | None) -> Callable[[int], Any]:
    """The loss of a step, with an interrupt in place of one of them."""

    def loss(step: int) -> Any:
        if step == at:
            raise KeyboardInterrupt
        return step_loss(step)

    return loss


def damage(path: Path, at: int = -1) -> None:
    """Flip a bit of one byte of a file."""
    data = bytearray(path.read_bytes())
    data[at] ^= 1
    path.write_bytes(data)
