"""Steps of both models on hand-made data."""

import dataclasses

import _hand_made
import numpy as np
import pytest
import torch
from _hand_made import DDF, PCSIREN, TRAIN

from ddf.models import reconstruction_models
from ddf.training import training_steps


def test_same_step_draws_the_same_batch_and_another_does_not():
    draws = [training_steps.Batch.draw(_hand_made.images(), TRAIN, step) for step in (3, 3, 4)]
    assert np.array_equal(draws[0].rows, draws[1].rows)
    assert not np.array_equal(draws[0].random.random(9), draws[2].random.random(9))
    assert len(set(draws[0].rows)) == 4


@pytest.mark.parametrize("told", [False, True])
@pytest.mark.parametrize("kind", ["ddf", "pcsiren"])
def test_steps_lower_the_loss_and_reach_every_parameter(kind, told):
    torch.manual_seed(0)
    train = dataclasses.replace(TRAIN, told=told)
    images, shapes = _hand_made.images(), _hand_made.shapes()
    if kind == "ddf":
        model = reconstruction_models.ddf_model(train, DDF.field)
        model.fit_cameras(images)
        samples = _hand_made.samples()

        def step(k):
            return training_steps.ddf_step(model, images, shapes, samples, train, DDF, k)
    else:
        model = reconstruction_models.pcsiren_model(train)
        model.fit_cameras(images)

        def step(k):
            return training_steps.pcsiren_step(model, images, shapes, train, PCSIREN, k)

    loss, terms = step(0)
    loss.backward()
    dead = [name for name, p in model.named_parameters() if p.grad is None or not bool(p.grad.abs().sum() > 0)]
    assert dead == []
    assert {"camera"} < set(terms)
    optimiser = torch.optim.Adam(model.parameters(), lr=3e-3)
    before = float(loss.detach())
    for _ in range(30):
        optimiser.zero_grad()
        loss, _ = step(0)
        loss.backward()
        optimiser.step()
    assert float(loss.detach()) < 0.8 * before if before > 0 else float(loss.detach()) < before
