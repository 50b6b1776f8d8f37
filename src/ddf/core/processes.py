"""Processes: how they end, by errors and signals; locks on files, which go with the process."""

import contextlib
import errno
import fcntl
import itertools
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from ddf.core import errors, extras

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_AGAIN = 1.0  # seconds: a terminal and a scheduler tell all processes, and those tell their children once more
_NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS)


class Interrupted(KeyboardInterrupt):
    """A signal ended the work. kept: what is left of it, for the user."""

    def __init__(self, number: int, kept: str = "") -> None:
        super().__init__(kept)
        self.number, self.kept = number, kept


def guarded(function: Callable[[], object], program: str, kept: str = "") -> int:
    """Call `function`; exit code 0, or 2 after one line on stderr when the user's input or disk is at fault.

    Args:
      kept: what is left, and how to go on, where a signal ends the work and nothing says it better; 128 and the
        signal's number is the code then.
    """
    try:
        function()
    except (errors.InputError, OSError) as error:
        sys.stderr.write(f"{program}: error: {' '.join(errors.describe(error).split())}\n")
        return 2
    except KeyboardInterrupt as stop:
        told = getattr(stop, "kept", "") or kept
        told += " the same command" if told.endswith(":") else ""
        sys.stderr.write(f"{program}: interrupted{f': {told}' if told else ''}\n")
        return 128 + getattr(stop, "number", signal.SIGINT)
    except ModuleNotFoundError as error:
        told = extras.hint(error)
        if told is None:
            raise
        sys.stderr.write(f"{program}: error: {told}\n")
        return 2
    return 0


class Noted:
    """The signal that came, 0 while none did, and when."""

    number, at = 0, 0.0


def _raise(number: int, _frame: Any) -> None:
    raise Interrupted(number)


@contextlib.contextmanager
def _handled(handler: Any) -> Iterator[None]:
    """One handler of both signals for a while; of the main thread alone, and not of a signal that is ignored."""
    numbers = _SIGNALS if threading.current_thread() is threading.main_thread() else ()
    before = {number: signal.getsignal(number) for number in numbers}
    try:
        for number, earlier in before.items():
            if earlier is not signal.SIG_IGN:
                signal.signal(number, handler)
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


def raised() -> contextlib.AbstractContextManager[None]:
    """Both signals raise `Interrupted`, through all that has to be tidied up."""
    return _handled(_raise)


def counted(start: int) -> Iterator[tuple[int, Noted]]:
    """Whole numbers from `start` on, for a loop that ends where it can go on later: the first signal is noted beside
    them, a second one raises `Interrupted`.
    """
    seen = Noted()

    def note(number: int, frame: Any) -> None:
        if seen.number and time.monotonic() - seen.at > _AGAIN:
            _raise(number, frame)
        seen.number, seen.at = number, time.monotonic()

    with _handled(note):
        for number in itertools.count(start):
            yield number, seen


@contextlib.contextmanager
def locked(path: Path, busy: str, wait: bool = True) -> Iterator[int]:
    """Hold the lock of a file, made if needed; gives its descriptor, for child processes to inherit.

    Args:
      busy: said where another process holds it, `{number}` standing for that process. wait: until it ends; else refuse.
    Raises:
      InputError: the file system has no locks, or another process holds it and `wait` is not set.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+", encoding="utf-8") as file:
        try:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                file.seek(0)
                said = busy.format(number=file.read().strip() or "unknown")
                if not wait:
                    raise errors.InputError(said) from None
                sys.stderr.write(f"{said}; waiting for it to end\n")
                sys.stderr.flush()
                fcntl.flock(file, fcntl.LOCK_EX)
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                raise
            raise errors.InputError(
                f"{path}: its file system has no locks ({error.strerror}), so two runs could mix their files; work "
                "in a folder on a local disk, or have it mounted with locks (NFS: lockd; Lustre: -o flock)"
            ) from error
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
        try:
            yield file.fileno()
        finally:
            file.truncate(0)
