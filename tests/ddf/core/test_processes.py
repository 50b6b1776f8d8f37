"""One holder at a time, and signals end loops where they can go on."""

import os
import signal

import pytest

from ddf.core import checks, processes


def test_a_second_holder_is_refused_with_the_number_of_the_first(tmp_path):
    path = tmp_path / "folder" / ".lock"
    with processes.locked(path, ""), pytest.raises(checks.InputError, match=f"process {os.getpid()} has it"):
        processes.locked(path, "process {number} has it", wait=False).__enter__()
    with processes.locked(path, "", wait=False):
        pass
    assert path.read_bytes() == b""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_loop_sees_the_first_signal_and_is_ended_by_a_later_one(number, monkeypatch):
    before, seen = signal.getsignal(number), []
    for step, noted in processes.counted(5):
        seen.append((step, noted.number))
        if step == 6:
            os.kill(os.getpid(), number)
        if noted.number and step == 8:
            break
    assert seen == [(5, 0), (6, 0), (7, number), (8, number)] and signal.getsignal(number) is before
    monkeypatch.setattr(processes, "_AGAIN", -1.0)
    with pytest.raises(processes.Interrupted) as caught:
        for _ in processes.counted(0):
            os.kill(os.getpid(), number)
    assert caught.value.number == number and signal.getsignal(number) is before


def test_an_ignored_signal_stays_ignored():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with processes.raised():
            os.kill(os.getpid(), signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)
