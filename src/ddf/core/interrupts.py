"""Ctrl-C and SIGTERM alike: what runs ends in order, and one line says what is kept and how to go on."""

import contextlib
import itertools
import signal
import threading
import time
from collections.abc import Iterator
from typing import Any

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_AGAIN = 1.0  # seconds: a terminal and a scheduler tell all processes, and those tell their children once more


class Interrupted(KeyboardInterrupt):
    """A signal ended the work. kept: what is left of it, for the user."""

    def __init__(self, number: int, kept: str = "") -> None:
        super().__init__(kept)
        self.number, self.kept = number, kept


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
