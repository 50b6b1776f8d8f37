"""Rays as NPZ files: `positions` and `directions`, (N, 3), in the frame of the mesh that they are meant for."""

import zipfile
import zlib
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
    checks.require_content(path)
    try:
        with zipfile.ZipFile(path) as archive:
            return [_array(archive, path, name) for name in names]
    except (checks.InputError, FileNotFoundError):
        raise
    except _DAMAGED as error:
        words = " and ".join(names)
        raise checks.InputError(f"{path}: not a readable NPZ file with {words} ({error or 'too large'})") from error


def _array(archive: zipfile.ZipFile, path: Path, name: str) -> np.ndarray:
    if f"{name}.npy" not in archive.namelist():
        raise checks.InputError(f"{path}: has no array {name!r}")
    with archive.open(f"{name}.npy") as member:
        version = np.lib.format.read_magic(member)
        header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, by_columns, kind = header(member)
        if len(shape) != 2 or shape[1] != 3 or kind.kind not in "fiu":
            raise checks.InputError(f"{path}: {name} must be numbers of shape (N, 3); got {kind} {shape}")
        if 24 * shape[0] > max(_FEW, _GROWTH * path.stat().st_size):
            raise checks.InputError(f"{path}: {name} claims {shape[0]:,} rows, too many for a file of this size")
        data = member.read(kind.itemsize * 3 * shape[0] + 1)
    if len(data) != kind.itemsize * 3 * shape[0]:
        raise checks.InputError(f"{path}: {name} claims {shape[0]:,} rows and holds another number")
    return np.frombuffer(data, kind).reshape(shape, order="F" if by_columns else "C").astype(np.float64, order="C")
