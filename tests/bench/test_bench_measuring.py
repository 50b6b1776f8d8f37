"""How benchmarks take seconds."""

import pytest

from bench.lib import measuring


class _Clock:
    """Stands still but for what candidates take."""

    def __init__(self):
        self.now, self.calls = 0.0, {}

    def candidate(self, name, *seconds):
        def work():
            taken = self.calls[name] = self.calls.get(name, 0) + 1
            self.now += seconds[min(taken, len(seconds)) - 1]

        return work


@pytest.fixture
def _clock(monkeypatch):
    clock = _Clock()
    monkeypatch.setattr(measuring.time, "perf_counter", lambda: clock.now)
    return clock


def test_a_sample_of_what_is_fast_is_the_mean_of_calls(_clock):
    tick = measuring.TICK
    fast = _clock.candidate("fast", *(seconds * tick / 3 for seconds in (1.0, 2.0) * 100))
    (times,) = measuring.interleaved({"fast": fast}, 7).values()
    # The second call says how many make a sample: two here, one of either length.
    assert times == pytest.approx([1.5 * tick / 3] * 7) and _clock.calls["fast"] == 2 + 2 * 7


def test_candidates_take_turns_and_slow_ones_leave(_clock):
    order, rough = [], (0.2, 0.2, 0.3, 0.4, 0.7) * 9
    ways = {"slow": _clock.candidate("slow", measuring.WARM), "rough": _clock.candidate("rough", *rough)}
    told = {name: (lambda name=name, way=way: (order.append(name), way())) for name, way in ways.items()}
    times = measuring.interleaved(told, 9, seconds=1.5 * measuring.WARM)
    assert times["slow"] == pytest.approx([measuring.WARM] * 2)  # it leaves after its second sample, the first a call
    assert order == ["slow", "rough", "slow", *["rough"] * len(times["rough"])]
    assert sum(times["rough"][:-1]) < 1.5 * measuring.WARM <= sum(times["rough"])
    assert len(measuring.interleaved({"rough": _clock.candidate("again", *rough)}, 3)["rough"]) == 3


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
