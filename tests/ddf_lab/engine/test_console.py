"""Lines of several processes stay whole; of a progress bar, a log gets the last state."""

import io
import os

from ddf_lab.engine import console


class _Terminal(io.StringIO):
    def isatty(self):
        return True


def _relayed(stream, *blocks):
    shown = console.Console(stream)
    for block in blocks:
        reader, writer = os.pipe()
        with os.fdopen(writer, "wb") as file:
            file.write(block)
        shown.relay(reader)
        os.close(reader)
    return stream.getvalue()


BAR = b"\rx:   0%|" + b"\rx:  50%|" * 3 + b"\rx: 100%|\n"


def test_a_log_gets_lines_and_the_end_of_a_bar():
    assert _relayed(io.StringIO(), b"first\n" + BAR + b"last") == "first\nx: 100%|\nlast\n"


def test_a_bar_that_never_ended_is_shown_as_far_as_it_came():
    assert _relayed(io.StringIO(), b"first\n\rx:   0%|\rx:  50%|") == "first\nx:  50%|\n"


def test_a_log_gets_a_state_once_in_a_while(monkeypatch):
    monkeypatch.setattr(console, "LOG_SECONDS", 0.0)
    assert _relayed(io.StringIO(), b"\rx:  50%|", b"\ry:  20%|\n") == "x:  50%|\nx:  50%|\ny:  20%|\n"


def test_a_terminal_shows_states_on_one_line(monkeypatch):
    monkeypatch.setattr(console, "DRAW_SECONDS", 0.0)
    monkeypatch.setenv("COLUMNS", "60")
    written = _relayed(_Terminal(), b"\rx:  50%|", b"name\n")
    assert written.startswith("\r\x1b[Kx:  50%|")
    assert written.endswith("\r\x1b[Kname\n")


def test_bytes_that_are_no_text_do_not_stop_it():
    assert _relayed(io.StringIO(), b"a\xffb\n") == "a�b\n"
