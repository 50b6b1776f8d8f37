"""Items run side by side as far as they may, in order, and a failure stops what follows from it alone."""

import os
import signal
import threading

import pytest

from ddf_lab.engine import graph, schedule


def _item(name, reads=(), together=None, seed=0):
    stage, _, key = name.partition("@")
    return graph.Item(stage, key, "", {}, tuple(f"out/{r}" for r in reads), (f"out/{name}",), "", seed, together)


CHAIN = [_item("a@x"), _item("a@y"), _item("b@x", ["a@x"]), _item("b@y", ["a@y"]), _item("c@", ["b@x", "b@y"])]


def _recorded(failing=()):
    started, lock = [], threading.Lock()

    def start(item):
        with lock:
            started.append(item.name)
        return item.name not in failing

    return started, start


def test_forerunners_come_first():
    started, start = _recorded()
    assert schedule.run(CHAIN, 3, start) == []
    assert sorted(started) == sorted(item.name for item in CHAIN)
    for before, after in (("a@x", "b@x"), ("a@y", "b@y"), ("b@x", "c@"), ("b@y", "c@")):
        assert started.index(before) < started.index(after)


def test_an_interrupt_stops_what_runs_and_starts_no_more():
    started, ended = [], threading.Event()

    def start(item):
        started.append(item.name)
        os.kill(os.getpid(), signal.SIGINT)
        return ended.wait(10)

    with pytest.raises(KeyboardInterrupt):
        schedule.run(CHAIN, 1, start, ended.set)
    assert ended.is_set() and started == ["a@x"]


def test_one_job_keeps_the_order_of_the_graph():
    started, start = _recorded()
    schedule.run(CHAIN, 1, start)
    assert started == [item.name for item in CHAIN]


def test_a_failure_leaves_out_what_follows_and_nothing_else():
    started, start = _recorded(failing=["a@x"])
    failed = schedule.run(CHAIN, 1, start)
    assert [item.name for item in failed] == ["a@x", "b@x", "c@"]
    assert started == ["a@x", "a@y", "b@y"]


def test_the_first_seed_goes_first():
    items = [_item("a@x"), _item("a@x-1", seed=1), _item("b@x", ["a@x"]), _item("b@x-1", ["a@x-1"], seed=1)]
    started, start = _recorded()
    schedule.run(items, 1, start)
    assert started == ["a@x", "b@x", "a@x-1", "b@x-1"]


def test_as_many_run_together_as_their_stages_say():
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

    for together, jobs in ((2, 8), (None, 2)):
        most.clear()
        assert schedule.run([_item(f"a@{i}", together=together) for i in range(4)], jobs, start) == []
        assert max(most) == 2


def test_a_group_waits_for_the_one_before():
    started, start = _recorded()
    items = [
        _item("a@x", together=2),
        _item("a@y", together=2),
        _item("b@x", ["a@x"]),
        _item("c@", ["b@x"], together=1),
    ]
    schedule.run(items, 4, start)
    assert set(started[:2]) == {"a@x", "a@y"} and started[2:] == ["b@x", "c@"]
