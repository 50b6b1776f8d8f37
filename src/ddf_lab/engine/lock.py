"""One run at a time in a folder. The lock is the kernel's, and goes with the last process of a run."""

import contextlib
import fcntl
import os
import sys
from collections.abc import Iterator
from pathlib import Path

FOLDER = Path(".make")


@contextlib.contextmanager
def held() -> Iterator[int]:
    """Wait for the lock, saying so in one line, and hold it; gives its descriptor, for child processes to inherit."""
    FOLDER.mkdir(exist_ok=True)
    owner = FOLDER / "lock.pid"
    with (FOLDER / "lock").open("a") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            number = owner.read_text(encoding="utf-8").strip() if owner.is_file() else "unknown"
            sys.stderr.write(f"another run holds this folder (process {number}); waiting for it to end\n")
            sys.stderr.flush()
            fcntl.flock(file, fcntl.LOCK_EX)
        owner.write_text(f"{os.getpid()}\n", encoding="utf-8")
        yield file.fileno()
