"""Rays as NPZ files: `positions` and `directions`, (N, 3), in the frame of the mesh that they are meant for."""

import zipfile
from pathlib import Path

import numpy as np

from ddf.core import checks
from ddf.geometry import rays


def read(path: Path) -> rays.OrientedPoints[np.ndarray]:
    """Positions and directions of an NPZ file, as float64, directions exactly of unit length.

    Raises:
      InputError: not an NPZ file with two (N, 3) arrays of numbers, or directions that are not of unit length.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            if not isinstance(file, np.lib.npyio.NpzFile):
                raise checks.InputError(f"{path}: must be an NPZ file with positions and directions")
            missing = {"positions", "directions"} - set(file.files)
            if missing:
                raise checks.InputError(f"{path}: has no array {sorted(missing)[0]!r}")
            arrays = [np.asarray(file[name]) for name in ("positions", "directions")]
    except checks.InputError:
        raise
    except (ValueError, zipfile.BadZipFile, EOFError, MemoryError) as error:
        raise checks.InputError(f"{path}: not a readable NPZ file ({error or 'too large'})") from error
    for name, array in zip(("positions", "directions"), arrays, strict=True):
        if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "fiu":
            raise checks.InputError(f"{path}: {name} must be numbers of shape (N, 3); got {array.dtype} {array.shape}")
    if len(arrays[0]) != len(arrays[1]):
        raise checks.InputError(f"{path}: {len(arrays[0])} positions but {len(arrays[1])} directions; must be as many")
    positions, directions = (array.astype(np.float64) for array in arrays)
    try:
        rays.OrientedPoints(positions, directions)
    except checks.InputError as error:
        raise checks.InputError(f"{path}: {error}") from error
    return rays.OrientedPoints(positions, directions / np.linalg.norm(directions, axis=-1, keepdims=True))
