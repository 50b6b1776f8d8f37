"""Rays as NPZ files: `positions` and `directions`, (N, 3), in the frame of the mesh that they are meant for."""

import math
import zipfile
import zlib
from collections.abc import Collection
from pathlib import Path

import numpy as np

from ddf.core import checks
from ddf.geometry import rays

_DAMAGED = (
    *(ValueError, zipfile.BadZipFile, zlib.error, EOFError, OSError),
    *(MemoryError, RuntimeError, LookupError, TypeError, AttributeError, SyntaxError, OverflowError),
)
_FEW, _GROWTH = (
    64 << 20,
    16,
)  # bytes as float64, and those for a byte of the file: what may be claimed without being read


def read(path: Path) -> rays.OrientedPoints[np.ndarray]:
    """Positions and directions of an NPZ file, as float64, directions exactly of unit length.

    Raises:
      InputError: not an NPZ file with two (N, 3) arrays of numbers, or directions that are not of unit length.
    """
    positions, directions = arrays(path, ("positions", "directions"))
    if len(positions) != len(directions):
        raise checks.InputError(f"{path}: {len(positions)} positions but {len(directions)} directions; must be as many")
    try:
        return rays.unit_points(positions, directions)
    except checks.InputError as error:
        raise checks.InputError(f"{path}: {error}") from error


def arrays(path: Path, names: tuple[str, ...]) -> list[np.ndarray]:
    """Named (N, 3) arrays of numbers of an NPZ file, as float64. What headers claim is judged before it is read.

    Raises:
      FileNotFoundError: there is no such file. InputError: something else; it is named.
    """
    found = numbers(path, names)
    for name in names:
        if name not in found:
            raise checks.InputError(f"{path}: has no array {name!r}")
        if found[name].ndim != 2 or found[name].shape[1] != 3:
            raise checks.InputError(f"{path}: {name} must be numbers of shape (N, 3); got shape {found[name].shape}")
    return [found[name] for name in names]


def numbers(path: Path, names: Collection[str]) -> dict[str, np.ndarray]:
    """Those of the named arrays that an NPZ file has, as float64; as `arrays`, of any shape."""
    checks.require_content(path)
    try:
        with zipfile.ZipFile(path) as archive:
            there = set(archive.namelist())
            return {name: _array(archive, path, name) for name in names if f"{name}.npy" in there}
    except (checks.InputError, FileNotFoundError):
        raise
    except _DAMAGED as error:
        words = " and ".join(names)
        raise checks.InputError(f"{path}: not a readable NPZ file with {words} ({error or 'too large'})") from error


def _array(archive: zipfile.ZipFile, path: Path, name: str) -> np.ndarray:
    with archive.open(f"{name}.npy") as member:
        version = np.lib.format.read_magic(member)
        header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, by_columns, kind = header(member)
        count = math.prod(shape)
        if kind.kind not in "fiu":
            raise checks.InputError(f"{path}: {name} must be numbers; got {kind} {shape}")
        if 8 * count > max(_FEW, _GROWTH * path.stat().st_size):
            raise checks.InputError(f"{path}: {name} claims {count:,} numbers, too many for a file of this size")
        data = member.read(kind.itemsize * count + 1)
    if len(data) != kind.itemsize * count:
        raise checks.InputError(f"{path}: {name} claims {count:,} numbers and holds another count")
    return np.frombuffer(data, kind).reshape(shape, order="F" if by_columns else "C").astype(np.float64, order="C")
