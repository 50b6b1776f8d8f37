"""How benchmarks take seconds."""

import pytest

from bench.lib import measuring


def test_samples_are_means_of_calls_taken_in_turn():
    """By a clock that the candidates move: the second call says how many make a sample."""
    now, order, lengths = [0.0], [], {"slow": [1.0] * 9, "fast": [measuring.TICK / 1.5] * 9}

    def call(name):
        order.append(name)
        now.append(lengths[name].pop())

    times = measuring.interleaved({name: lambda name=name: call(name) for name in lengths}, 3, lambda: sum(now))
    assert times == {"slow": pytest.approx([1.0] * 3), "fast": pytest.approx([measuring.TICK / 1.5] * 3)}
    assert order == ["slow"] * 2 + ["fast"] * 2 + ["slow", "fast", "fast"] * 3


def test_steps_fill_the_seconds_with_what_comes_before_them(monkeypatch):
    """A training of 2 s and 0.1 s a step, by a clock that it moves itself."""
    now = [0.0]
    monkeypatch.setattr(measuring.time, "process_time", lambda: sum(now))

    def train(steps):
        now.append(2.0 + 0.1 * steps)

    assert abs(measuring.steps_within(train, 12.0) - 100) <= 1
    assert measuring.steps_within(train, 0.1) == 1
    assert len(now) == 1 + 6
    with pytest.raises(RuntimeError, match="too few to tell"):
        measuring.steps_within(lambda steps: None, 1.0)
