"""Checks at the public boundary; each raises with the name, the rule and what came.

Values are numpy arrays or torch tensors; torch is not imported here, so that bad input is refused without its 0.6 GiB.
"""

import reprlib
from pathlib import Path
from typing import Any

import numpy as np

from ddf.core import arrays, errors

UNIT_LENGTH_TOLERANCE = 1e-4  # float32 directions that went through a file or a rotation are within 1e-6; typos are not
_POINTER = b"version https://git-lfs.github.com/spec/"
InputError = errors.InputError


def require_content(path: str | Path) -> None:
    """Raise where a Git LFS pointer stands in place of a file's content."""
    with Path(path).open("rb") as file:
        if file.read(len(_POINTER)) == _POINTER:
            raise InputError(f"{path}: a Git LFS pointer, not the file itself; get it by: git lfs pull")


def require_whole(name: str, value: Any, least: int) -> int:
    """Raise unless a value is a whole number, `least` or more."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise InputError(f"{name} must be a whole number, {least} or more; got {value!r}")
    return int(value)


def require_numbers(name: str, values: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Finite numbers of a shape as float64, from lists as JSON has them: no words, no true or false."""
    found = np.array(values, dtype=object)
    if found.shape != shape or any(
        isinstance(each, bool) or not isinstance(each, int | float | np.number) for each in found.flat
    ):
        kind = f"a {'x'.join(map(str, shape))} matrix of numbers" if shape else "a number"
        raise InputError(f"{name} must be {kind}; got {reprlib.repr(values)}")
    try:
        wide = found.astype(np.float64)
    except OverflowError as error:
        raise InputError(f"{name} must be finite; got a number beyond 1e308") from error
    require_finite(name, wide)
    return wide


def require_vectors(name: str, values: Any) -> None:
    """Raise unless the last axis has length 3."""
    if values.ndim == 0 or values.shape[-1] != 3:
        raise InputError(f"{name} must have a last axis of length 3; got shape {tuple(values.shape)}")


def require_finite(name: str, values: Any) -> None:
    """Raise unless every entry is finite, naming the first that is not."""
    array = arrays.to_numpy(values)
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        index = tuple(int(i) for i in bad[0])
        raise InputError(f"{name} must be finite; got {array[index]} at index {index} ({len(bad)} such values)")


def require_unit(name: str, directions: Any) -> None:
    """Raise unless every vector along the last axis has length 1 within `UNIT_LENGTH_TOLERANCE`."""
    require_vectors(name, directions)
    lengths = np.linalg.norm(np.asarray(arrays.to_numpy(directions), dtype=np.float64), axis=-1)
    bad = np.argwhere(~(np.abs(lengths - 1.0) <= UNIT_LENGTH_TOLERANCE))
    if len(bad):
        index = tuple(int(i) for i in bad[0])
        raise InputError(
            f"{name} must be unit length (tol {UNIT_LENGTH_TOLERANCE:g}); got {lengths[index]:.6g} at index {index}"
        )
