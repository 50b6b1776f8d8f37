"""Comparison of arrays for all tests: tolerance by type, the worst entry named; and damage to a file."""

from pathlib import Path
from typing import Any

import numpy as np
import torch

# Absolute and relative; float32 and float16 leave room for sums of some hundred terms.
TOLERANCES = {"float64": (1e-10, 1e-9), "float32": (1e-5, 1e-4), "float16": (2e-3, 5e-3), "bfloat16": (1e-2, 1e-2)}
MAX_RTOL = 1e-2


def assert_close(actual: Any, expected: Any, *, atol: float | None = None, rtol: float | None = None) -> None:
    """Raise unless |actual - expected| <= atol + rtol |expected| everywhere, shapes being equal.

    Tolerances default to those of the coarser type of the two; equal infinities agree, NaN never does.
    """
    dtype = _coarser(actual, expected)
    default_atol, default_rtol = TOLERANCES.get(dtype, (0.0, 0.0))
    atol = default_atol if atol is None else atol
    rtol = default_rtol if rtol is None else rtol
    if rtol > MAX_RTOL:
        raise ValueError(f"rtol must be <= {MAX_RTOL}; got {rtol}")
    left, right = _as_float64(actual), _as_float64(expected)
    if left.shape != right.shape:
        raise AssertionError(f"shapes differ: {left.shape} against {right.shape}")
    with np.errstate(invalid="ignore"):
        error = np.where(left == right, 0.0, np.abs(left - right))
        allowed = atol + rtol * np.where(np.isfinite(right), np.abs(right), 0.0)
        excess = np.where(np.isnan(error), np.inf, error) - allowed
    if excess.size and excess.max() > 0:
        index = tuple(int(i) for i in np.unravel_index(int(excess.argmax()), excess.shape))
        count = int((excess > 0).sum())
        raise AssertionError(
            f"{count} of {excess.size} entries differ; the worst at {index}: {left[index]!r} against {right[index]!r} "
            f"(difference {error[index]:.3g}, allowed {allowed[index]:.3g}, {dtype})"
        )


def _coarser(*values: Any) -> str:
    order = ["bfloat16", "float16", "float32", "float64"]
    names = [str(v.dtype).removeprefix("torch.") for v in values if hasattr(v, "dtype")]
    floats = [name for name in names if name in order]
    if floats:
        return min(floats, key=order.index)
    return names[0] if names else "float64"


def _as_float64(value: Any) -> np.ndarray:
    if isinstance(value, torch.Tensor):
        value = value.detach().cpu().double().numpy()
    return np.asarray(value, dtype=np.float64)


def damage(path: Path, at: int = -1) -> None:
    """Flip a bit of one byte of a file."""
    data = bytearray(path.read_bytes())
    data[at] ^= 1
    path.write_bytes(data)
