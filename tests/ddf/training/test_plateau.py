"""The plateau schedule: by hand, and in the loop through a kill."""

import dataclasses

import pytest
import torch
from torch import nn

from ddf.models import loop_config
from ddf.training import optimisers, plateau, training_loop

LOOP = loop_config.LoopConfig(1e-2, "plateau", 0, None, 1, 0, 1, 0.0)


def _rows(*means):
    """Two logged losses of each 5,000 steps, with these means."""
    return [
        {"step": 5000.0 * i + place, "loss": mean + side}
        for i, mean in enumerate(means)
        for place, side in ((2500, 0.3), (5000, -0.3))
    ]


@pytest.mark.parametrize(
    ("means", "step", "reduced"),
    [
        ((3.0, 2.0, 1.0), 15000, 0),
        ((3.0, 3.0), 9999, 0),  # the second 5,000 are not over
        ((3.0, 3.0), 10000, 1),
        ((3.0, 3.5, 2.0, 2.5, 2.4), 25000, 3),  # once for each 5,000 without a new best
        ((-3.0, -3.5, -3.2), 15000, 1),
        ((), 0, 0),
    ],
)
def test_one_reduction_for_each_5000_steps_without_a_better_mean(means, step, reduced):
    assert plateau.reductions(_rows(*means), step) == reduced
    assert LOOP.rate(step, 10**6, reduced) == pytest.approx(1e-2 * 0.9**reduced)


def test_a_resumed_training_has_the_rates_of_an_uninterrupted_one(tmp_path, monkeypatch):
    monkeypatch.setattr(plateau, "APART", 4)
    rates = {}

    def train(folder, stops):
        seen = rates.setdefault(folder, [])
        for stop in stops:
            model = nn.Linear(1, 1, bias=False)
            nn.init.ones_(model.weight)
            optimiser = optimisers.of

            def watched(*given, made=optimiser):
                found = made(*given)
                set_rate = found.set_rate
                found.set_rate = lambda rate: (seen.append(rate), set_rate(rate))
                return found

            monkeypatch.setattr(optimisers, "of", watched)

            def loss(step, model=model, stop=stop):
                if step == stop:
                    raise KeyboardInterrupt
                return 0 * model.weight.sum() + torch.tensor(1.0), {}

            try:
                training_loop.fit(
                    model, [{"params": list(model.parameters())}], loss, 14, LOOP, folder, {"fingerprint": "x"}, "x"
                )
            except KeyboardInterrupt:
                seen.pop()
            monkeypatch.setattr(optimisers, "of", optimiser)

    train(tmp_path / "whole", [None])
    train(tmp_path / "parts", [6, 11, None])
    assert rates[tmp_path / "whole"] == rates[tmp_path / "parts"]
    expected = [1e-2] * 8 + [9e-3] * 4 + [8.1e-3] * 2
    assert rates[tmp_path / "whole"] == pytest.approx(expected)
    assert dataclasses.replace(LOOP, schedule="constant").rate(13, 14) == 1e-2
