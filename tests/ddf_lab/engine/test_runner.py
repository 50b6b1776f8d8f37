"""Items run side by side as far as they may, and a failure stops what follows from it alone; lines stay whole."""

import dataclasses
import io
import os
import signal
import subprocess
import threading
from pathlib import Path
from typing import Literal
from unittest import mock

import pytest

from ddf_lab.engine import graph, runner


def _item(name, reads=(), together: int | Literal["jobs"] = "jobs", seed=0):
    stage, _, key = name.partition("@")
    entry = graph.Stage((), (), "", (), tuple(reads), (name,), together)
    return graph.Item(stage, entry, Path("e.yaml"), key, seed)


CHAIN = [_item("a@x"), _item("a@y"), _item("b@x", ["a@x"]), _item("b@y", ["a@y"]), _item("c@", ["b@x", "b@y"])]
SEEDED = [_item("a@x"), _item("a@x1", seed=1), _item("b@x", ["a@x"]), _item("b@x1", ["a@x1"], seed=1)]


def _names(items):
    return [f"{item.stage}@{item.category}" for item in items]


def _recorded(failing=()):
    started, lock = [], threading.Lock()

    def start(item):
        with lock:
            started.extend(_names([item]))
        return started[-1] not in failing

    return started, start


def test_forerunners_come_first():
    started, start = _recorded()
    assert runner.schedule(CHAIN, 3, start) == []
    assert sorted(started) == sorted(_names(CHAIN))
    for before, after in (("a@x", "b@x"), ("a@y", "b@y"), ("b@x", "c@"), ("b@y", "c@")):
        assert started.index(before) < started.index(after)


@pytest.mark.parametrize(
    ("items", "failing", "ran", "left"),
    [
        (CHAIN, (), _names(CHAIN), []),  # one job keeps the order of the graph
        (CHAIN, ("a@x",), ["a@x", "a@y", "b@y"], ["a@x", "b@x", "c@"]),  # what follows a failure is left out, no more
        (SEEDED, (), ["a@x", "b@x", "a@x1", "b@x1"], []),  # the first seed goes first
    ],
)
def test_one_job_keeps_the_order(items, failing, ran, left):
    started, start = _recorded(failing)
    assert (_names(runner.schedule(items, 1, start)), started) == (left, ran)


def test_an_interrupt_stops_what_runs_and_starts_no_more():
    started, ended = [], threading.Event()

    def start(item):
        started.extend(_names([item]))
        os.kill(os.getpid(), signal.SIGINT)
        return ended.wait(10)

    with pytest.raises(KeyboardInterrupt):
        runner.schedule(CHAIN, 1, start, ended.set)
    assert ended.is_set() and started == ["a@x"]


def test_each_stage_is_told_which_of_how_many_it_is(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(runner.stage, "checksums", lambda _: mock.Mock())
    monkeypatch.setattr(runner.stage, "note", lambda item, _: mock.Mock(fits=lambda: item.stage == "done"))
    work = runner._Work(tmp_path, "", 2, 3)
    items = [_item(name) for name in ("done", "a", "b")]
    told = [
        dataclasses.replace(
            each, entry=dataclasses.replace(each.entry, command=f"printf '%s%s\\n' {each.stage} \"$DDF_PART\" #")
        )
        for each in items
    ]
    assert [work.run(each) for each in told] == [True] * 3
    assert capfd.readouterr().err == "a (2 of 3)\nb (3 of 3)\n"


def test_a_process_that_lost_the_signal_is_told_again(monkeypatch):
    monkeypatch.setattr(runner, "PATIENCE", 0.1)
    deaf = "n=0; trap 'n=$((n + 1)); [ $n -gt 1 ] && exit 7' TERM; echo; while :; do sleep 0.01; done"
    with subprocess.Popen(["/bin/sh", "-c", deaf], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stdout.readline() == b"\n"
        runner.end([process])
        assert process.returncode == 7


@pytest.mark.parametrize(("together", "jobs"), [(2, 8), ("jobs", 2)])
def test_as_many_run_together_as_their_stages_say(together, jobs):
    """Two meet at a barrier that no single one could pass; a third is never among them."""
    running, most, lock, barrier = 0, [], threading.Lock(), threading.Barrier(2)

    def start(_):
        nonlocal running
        with lock:
            running += 1
            most.append(running)
        barrier.wait(timeout=60)
        with lock:
            running -= 1
        return True

    assert runner.schedule([_item(f"a@{i}", together=together) for i in range(4)], jobs, start) == []
    assert max(most) == 2


def test_stages_that_say_different_numbers_never_run_together():
    running, lock = [], threading.Lock()

    def start(item):
        with lock:
            running.append(item)
            assert len({each.entry.together for each in running}) == 1
        with lock:
            running.remove(item)
        return True

    kinds: dict[str, int | Literal["jobs"]] = {"a": 2, "b": "jobs", "c": 1}
    items = [_item(f"{stage}@{i}", together=how) for stage, how in kinds.items() for i in "xyz"]
    assert runner.schedule(items, 4, start) == []


def _relayed(stream, *blocks):
    shown = runner.Console(stream)
    for block in blocks:
        reader, writer = os.pipe()
        with os.fdopen(writer, "wb") as file:
            file.write(block)
        shown.relay(reader)
        os.close(reader)
    return stream.getvalue()


BAR = b"\rx:   0%|" + b"\rx:  50%|" * 3 + b"\rx: 100%|\n"


@pytest.mark.parametrize(
    ("block", "written"),
    [
        (b"first\n" + BAR + b"last", "first\nx: 100%|\nlast\n"),
        (b"first\n\rx:   0%|\rx:  50%|", "first\nx:  50%|\n"),  # a bar that never ended
        (b"x:  50%|\rx: 100%|\r", "x: 100%|\n"),  # returns that follow what they end
        (b"a\xffb\n", "a�b\n"),
    ],
)
def test_a_log_gets_lines_and_the_end_of_a_bar(block, written):
    assert _relayed(io.StringIO(), block) == written
