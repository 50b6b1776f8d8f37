"""What stages that run side by side write, in whole lines: on a terminal with one line of all progress below them."""

import os
import shutil
import threading
import time
from typing import Any

DRAW_SECONDS, LOG_SECONDS = 0.2, 60.0  # between two states of a progress bar, on a terminal and in a log


class Console:
    """Takes the bytes that processes write and writes lines; of a progress bar, few of its states."""

    def __init__(self, stream: Any) -> None:
        self._stream, self._terminal = stream, stream.isatty()
        self._lock = threading.Lock()
        self._states: dict[int, str] = {}
        self._shown: dict[int, float] = {}

    def relay(self, descriptor: int) -> None:
        """Read a process's output to its end."""
        rest = b""
        try:
            while block := os.read(descriptor, 65536):
                *lines, rest = (rest + block).split(b"\n")
                for line in lines:
                    self._line(descriptor, _last_state(line))
                if b"\r" in rest:
                    rest = b"\r" + rest.rsplit(b"\r", 1)[1]
                    self._state(descriptor, _last_state(rest))
            if state := _last_state(rest):
                self._line(descriptor, state)
        finally:
            self._states.pop(descriptor, None)
            self._shown.pop(descriptor, None)

    def _line(self, source: int, text: str) -> None:
        with self._lock:
            self._states.pop(source, None)
            if text:
                self._stream.write(f"\r\x1b[K{text}\n" if self._terminal else f"{text}\n")
            self._draw()

    def _state(self, source: int, text: str) -> None:
        """A bar moved on; in a log it is written once a minute, its last state as a line."""
        with self._lock:
            self._states[source] = text
            now = time.monotonic()
            if now - self._shown.setdefault(source, now) >= (DRAW_SECONDS if self._terminal else LOG_SECONDS):
                self._shown[source] = now
                if not self._terminal:
                    self._stream.write(f"{text}\n")
                self._draw()

    def _draw(self) -> None:
        if self._terminal and self._states:
            width = shutil.get_terminal_size().columns
            share = max(20, (width - 1) // len(self._states) - 3)
            self._stream.write("\r\x1b[K" + " | ".join(state[:share] for state in self._states.values())[: width - 1])
        self._stream.flush()


def _last_state(line: bytes) -> str:
    """What a line shows at its end: the text after its last carriage return that is followed by any."""
    states = [part.strip() for part in line.decode("utf-8", "replace").split("\r")]
    return next((state for state in reversed(states) if state), "")
