"""Steps on random data are those of a training, of the sizes asked for."""

import dataclasses
import itertools

import _models
import pytest
import torch

from ddf.data import packing
from ddf.data.samples import sample_types
from ddf.models import reconstruction_settings
from ddf_lab.engine import step_cost


def test_random_samples_are_valid_ones_of_every_type():
    samples = step_cost.random_samples(2)
    for kind in sample_types.KINDS:
        names = [f"{kind}.{name}" for name in packing.FIELDS]
        codes = {name: torch.from_numpy(samples.shards[0][name][:, :500]) for name in names}
        found = packing.decode(codes, kind)
        unit = torch.ones(2, 500)
        torch.testing.assert_close(found["directions"].norm(dim=-1), unit, atol=1e-5, rtol=0)
        torch.testing.assert_close(found["normals"].norm(dim=-1), unit, atol=1e-5, rtol=0)
        assert float(found["positions"].abs().max()) <= 1 and bool((found["depth"] >= 0).all())


def test_random_images_show_cameras_of_the_renders():
    images = step_cost.random_images(50, 32)
    assert images.images[49].shape == (4, 32, 32) and images.images[0].dtype == torch.uint8
    lowest, highest = images.cameras.amin(0), images.cameras.amax(0)
    assert bool((lowest >= torch.tensor([0.0, 0.43, 0.65])).all()) and bool((lowest < highest).all())
    assert bool((highest <= torch.tensor([2 * torch.pi, 0.52, 0.95])).all())


@pytest.mark.parametrize("kind", ["ddf", "pcsiren"])
def test_a_trial_makes_the_steps_of_a_training(kind):
    torch.manual_seed(0)
    section = _models.DDF if kind == "ddf" else _models.PCSIREN
    trial = step_cost.trial(_models.TRAIN, section)
    before = [parameter.detach().clone() for parameter in trial.model.parameters()]
    trial.backward(0)
    still = [name for name, p in trial.model.named_parameters() if p.grad is None]
    assert still == [] and trial.model.training
    trial.optimiser.step()
    assert all(not torch.equal(old, new) for old, new in zip(before, trial.model.parameters(), strict=True))


@pytest.mark.parametrize("kind", ["ddf", "pcsiren"])
def test_a_trial_decays_what_a_training_decays(kind, monkeypatch):
    monkeypatch.setattr(reconstruction_settings, "WEIGHT_DECAY_SHAPE", 20.0)
    monkeypatch.setattr(reconstruction_settings, "WEIGHT_DECAY_CAMERA", 10.0)
    trial = step_cost.trial(_models.TRAIN, _models.DDF if kind == "ddf" else _models.PCSIREN)
    before = {name: parameter.detach().clone() for name, parameter in trial.model.named_parameters()}
    for parameter in trial.model.parameters():
        parameter.grad = torch.zeros_like(parameter)
    trial.optimiser.step()
    kept = {"shape_encoder": 0.98, "camera_encoder": 0.99, "decoder": 1.0}
    for name, parameter in trial.model.named_parameters():
        expected = kept[name.partition(".")[0]] * before[name]
        torch.testing.assert_close(parameter.detach(), expected, rtol=1e-5, atol=0)


def test_seconds_of_a_step_are_scaled_from_fewer_images(monkeypatch):
    clock = itertools.count(0.0, 0.5)  # half a second passes whenever one looks
    monkeypatch.setattr(step_cost, "now", lambda: next(clock))
    monkeypatch.setattr(step_cost, "MOST_IMAGES", 2)
    train = dataclasses.replace(_models.TRAIN, batch_size=6)
    cost = step_cost.measure(train, _models.DDF)
    assert (cost.batch_size, cost.trial_images, cost.trial_seconds, cost.optimiser_seconds) == (6, 2, 0.5, 0.5)
    assert cost.seconds == 0.5 + 3 * 0.5
    monkeypatch.setattr(step_cost, "MOST_IMAGES", 100)
    assert step_cost.measure(train, _models.DDF).trial_images == 6
    monkeypatch.setattr(step_cost, "MOST_POINTS", 4 * (sum(_models.DDF.counts.values()) + 20))
    assert step_cost.measure(train, _models.DDF).trial_images == 4
    monkeypatch.setattr(step_cost, "MOST_POINTS", 1)
    assert step_cost.measure(train, reconstruction_settings.PCSirenConfig(1, 8, 8)).trial_images == 2
