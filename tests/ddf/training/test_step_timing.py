import functools

import pytest
import torch

from ddf.fields import siren
from ddf.training import step_timing, training_loop

LOOP = training_loop.LoopConfig(5e-3, "cosine", 10, 1.0, 1, 0, 50, 1e9, muon=0.02)


class Clock:
    """Stands for the time of a training: a step takes as long as `seconds` says of it."""

    def __init__(self, seconds):
        self.now, self.seconds, self.steps = 0.0, seconds, []

    def monotonic(self):
        return self.now

    def loss(self, model, step):
        self.now += self.seconds(step)
        self.steps.append(step)
        return model(torch.ones(4, 3)).square().mean(), {}


def _groups(model):
    return [{"params": list(model.parameters()), "weight_decay": 0.1}]


def _trainee(network, loss):
    return step_timing.Trainee(network, _groups, lambda model: functools.partial(loss, model), LOOP)


def _network():
    return siren.SineNetwork(3, siren.SineLayout((8, 8)), 1)


def _measure(monkeypatch, seconds, budget):
    """Seconds of a step by such a clock, the network timed and the steps that were made."""
    clock, network = Clock(seconds), _network()
    monkeypatch.setattr(training_loop, "time", clock)
    before = [weight.detach().clone() for weight in network.parameters()]
    found = step_timing.seconds_per_step(_trainee(network, clock.loss), budget)
    assert all(torch.equal(*pair) for pair in zip(before, network.parameters(), strict=True))
    return found, clock.steps


def test_mean_of_later_steps(monkeypatch):
    """The first half, where memory is touched for the first time, does not count; slow steps among the others do."""
    found, steps = _measure(monkeypatch, lambda step: (9.0, 9.0, 9.0, 9.0, 0.5, 0.5, 0.5, 2.5)[step], 10.0)
    assert found == pytest.approx(1.0)
    assert steps == [*range(8)]


@pytest.mark.parametrize(("budget", "second"), [(1000.0, 30), (1050.0, 30), (1e5, 400)])
def test_longer_trial_takes_a_share_of_the_budget(monkeypatch, budget, second):
    found, steps = _measure(monkeypatch, lambda step: 1.0, budget)
    assert found == pytest.approx(1.0)
    assert steps == [*range(8), *range(second)]


def test_two_trainings_are_compared_in_turn(monkeypatch):
    """A busy time meets both, and a moment that meets one alone is outvoted."""
    clock, timed, turn = Clock(lambda step: 0.0), [], 2 * step_timing.FIRST_TRIAL
    monkeypatch.setattr(training_loop, "time", clock)

    def trainee(name, seconds):
        def loss(model, step):
            timed.append(name)
            busy = 7.0 if len(timed) > turn else 1.0  # from the second turn on
            alone = 50.0 if len(timed) == 3 * turn + 6 else 0.0  # in the fourth
            clock.seconds = lambda step: busy * seconds + alone
            return clock.loss(model, step)

        return _trainee(_network(), loss)

    assert step_timing.times_as_long(trainee("one", 3.0), trainee("other", 2.0)) == pytest.approx(1.5)
    assert timed == step_timing.TURNS * [*["one"] * step_timing.FIRST_TRIAL, *["other"] * step_timing.FIRST_TRIAL]
