"""Steps of the shape VAE: its loss, and trainings that are resumed."""

import functools

import _generative
import numpy as np
import pytest
import torch
from _support import assert_close

from ddf.fields import losses, model_files
from ddf.models import point_encoder
from ddf.training import training_loop, vae_step

SHAPES = _generative.shapes()


def _fit(folder, stop_at=None):
    training_loop.prepare(_generative.LOOP, 2)
    model = _generative.vae().train()

    def loss(step):
        if step == stop_at:
            raise KeyboardInterrupt
        return vae_step.vae_step(model, SHAPES, step)

    training_loop.fit(model, model.parameter_groups(), loss, 4, _generative.LOOP, folder, {"fingerprint": "x"}, "vae")
    return (folder / model_files.MODEL).read_bytes()


def test_two_runs_agree_and_a_resumed_one_equals_an_uninterrupted_one(tmp_path):
    whole = _fit(tmp_path / "whole")
    assert whole == _fit(tmp_path / "again")
    with pytest.raises(KeyboardInterrupt):
        _fit(tmp_path / "parts", stop_at=2)
    assert whole == _fit(tmp_path / "parts")


def test_the_loss_is_that_of_the_shape_and_the_divergence():
    model = _generative.vae()  # in evaluation mode: no dropout
    total, terms = vae_step.vae_step(model, SHAPES, 0)
    random = np.random.default_rng((0, 0))
    drawn = random.choice(3, 2, replace=False)
    clouds = SHAPES.clouds(drawn, 10, random)
    noise = torch.from_numpy(random.standard_normal((2, 5)).astype(np.float32))
    points = SHAPES.draw(drawn, model.config.counts, random)
    mean, log_variance = model.posterior(*clouds)
    latent = mean + (0.5 * log_variance).exp() * noise
    shape_loss, _ = losses.shape_loss(
        model.decoder.field, points, model.decoder.modulator(latent), model.config.weights
    )
    divergence = point_encoder.divergence(mean, log_variance).mean(0).sum()
    assert_close(terms["divergence"], divergence)
    assert_close(total, shape_loss + 0.05 * divergence)


def test_encoder_and_decoder_both_get_gradients():
    model = _generative.vae().train()
    vae_step.vae_step(model, SHAPES, 0)[0].backward()
    still = [name for name, each in model.named_parameters() if each.grad is None or not each.grad.any()]
    # biases before a batch normalisation have none but rounding
    assert not [name for name in still if not name.endswith("bias")]


def test_a_part_of_the_clouds_is_that_of_all():
    both = functools.partial(SHAPES.clouds, np.array([2, 0, 1]), 4)
    part = both(np.random.default_rng(0), slice(1, 2))[0]
    assert_close(part[0], both(np.random.default_rng(0))[0][1])
