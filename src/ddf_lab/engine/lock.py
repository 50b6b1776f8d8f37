"""One run at a time in a folder."""

import contextlib
from pathlib import Path

from ddf.core import locks

FOLDER = Path(".make")


def held() -> contextlib.AbstractContextManager[int]:
    """Wait for the lock, saying so in one line, and hold it; gives its descriptor, for child processes to inherit."""
    return locks.held(FOLDER / "lock", "another run holds this folder (process {number})")
