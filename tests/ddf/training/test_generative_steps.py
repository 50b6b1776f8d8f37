"""Updates of the VAE and of both GANs."""

import functools
import math

import _generative
import numpy as np
import pytest
import torch
from _support import assert_close, stopped
from torch import nn

from ddf.fields import losses, model_files
from ddf.models import generative_models
from ddf.training import generative_steps, training_loop

SHAPES = _generative.shapes()
GANS = {
    "image": (
        _generative.image_gan,
        lambda model: generative_steps.image_updates(model, _generative.images(), _generative.normals()),
    ),
    "noise": (_generative.noise_gan, lambda model: generative_steps.noise_updates(model, _generative.images())),
}
MODELS = {**GANS, "vae": (_generative.vae, lambda model: [functools.partial(generative_steps.vae_step, model, SHAPES)])}


class _Linear(nn.Module):
    """D(x) = slope * sum(x)."""

    def __init__(self, slope):
        super().__init__()
        self.slope = nn.Parameter(torch.tensor(slope))

    def forward(self, images):
        return self.slope * images.sum(dim=(1, 2, 3))


def test_the_critics_loss_has_its_closed_form():
    critic, real, fake = _Linear(0.5), torch.full((2, 3, 2, 2), 0.1), torch.full((2, 3, 2, 2), -0.2)
    loss, terms = generative_steps.critic_loss(critic, real, fake, 10.0)
    wanted = math.log1p(math.exp(-0.6)) + math.log1p(math.exp(-1.2)) + 10 * 12 * 0.25
    assert float(loss.detach()) == pytest.approx(wanted)
    assert float(terms["penalty"]) == pytest.approx(12 * 0.25)
    loss.backward()
    slopes = -1.2 / (1 + math.exp(0.6)) - 2.4 / (1 + math.exp(1.2)) + 10 * 24 * 0.5
    assert critic.slope.grad is not None
    assert float(critic.slope.grad) == pytest.approx(slopes)
    assert "penalty" not in generative_steps.critic_loss(critic, real.detach(), fake, 0.0)[1]


def test_the_generators_loss_does_not_saturate_and_leaves_the_critic_alone():
    critic, fake = _Linear(2.0), torch.full((1, 3, 2, 2), -0.5, requires_grad=True)
    loss = generative_steps.adversarial_loss(critic, fake)
    assert float(loss.detach()) == pytest.approx(math.log1p(math.exp(12)))
    loss.backward()
    assert critic.slope.grad is None and critic.slope.requires_grad
    assert_close(fake.grad, torch.full_like(fake, -2 / (1 + math.exp(-12))).detach())


@pytest.mark.parametrize("kind", GANS)
def test_every_update_of_a_step_draws_numbers_of_its_own(kind, monkeypatch):
    make, updates = GANS[kind]
    turns, own = [], generative_steps.Draw.of
    monkeypatch.setattr(
        generative_steps.Draw, "of", lambda gan, step, turn: turns.append((step, turn)) or own(gan, step, turn)
    )
    steps = updates(make())
    for update in steps:
        update(5)
    assert turns == [(5, turn) for turn in range(len(steps))] and len(steps) > 1


def test_images_are_laid_on_white():
    image = torch.tensor([0.5, 0.0, 1.0, 0.5]).reshape(1, 4, 1, 1)
    assert_close(generative_steps.on_white(image).flatten(), torch.tensor([0.5, 0.0, 1.0]))


@pytest.mark.parametrize("name", GANS)
def test_critic_and_generator_are_moved_by_their_own_updates(name):
    make, updates_of = GANS[name]
    model = make()
    *critic, generator = updates_of(model)
    assert len(critic) == 2
    for update, own in ((critic[0], True), (generator, False)):
        model.zero_grad(set_to_none=True)
        update(0)[0].backward()
        moved = {part.split(".")[0] for part, each in model.named_parameters() if each.grad is not None}
        wanted = {"critic"} if own else ({"generator"} if name == "noise" else {"colours", "normals", "textures"})
        assert moved == wanted


def _fit(name, folder, stop_at=None):
    training_loop.prepare(_generative.LOOP)
    make, updates_of = MODELS[name]
    model = make().train()
    *others, last = updates_of(model)
    updates = [*others, stopped(last, stop_at)]
    groups = model.parameter_groups()
    training_loop.fit(model, groups, updates, 3, _generative.LOOP, folder, {"fingerprint": "x"}, name)
    return (folder / model_files.MODEL).read_bytes()


@pytest.mark.parametrize("name", MODELS)
def test_a_resumed_training_equals_an_uninterrupted_one(name, tmp_path):
    whole = _fit(name, tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        _fit(name, tmp_path / "parts", stop_at=1)
    assert whole == _fit(name, tmp_path / "parts")


def test_the_loss_is_that_of_the_shape_and_the_divergence():
    model = _generative.vae()  # in evaluation mode: no dropout
    total, terms = generative_steps.vae_step(model, SHAPES, 0)
    random = np.random.default_rng((0, 0))
    drawn = random.choice(3, 2, replace=False)
    clouds = SHAPES.clouds(drawn, 10, random)
    noise = torch.from_numpy(random.standard_normal((2, 5)).astype(np.float32))
    points = SHAPES.samples.draw(drawn, model.config.counts, random)
    mean, log_variance = model.posterior(*clouds)
    latent = mean + (0.5 * log_variance).exp() * noise
    modulations = model.decoder.modulator(latent)
    shape_loss, _ = losses.shape_loss(model.decoder.field, points, modulations, model.config.weights)
    divergence = generative_models.divergence(mean, log_variance).mean(0).sum()
    assert_close(terms["divergence"], divergence)
    assert_close(total, shape_loss + 0.05 * divergence)


def test_encoder_and_decoder_both_get_gradients():
    model = _generative.vae().train()
    generative_steps.vae_step(model, SHAPES, 0)[0].backward()
    still = [name for name, each in model.named_parameters() if each.grad is None or not each.grad.any()]
    # biases before a batch normalisation have none but rounding
    assert not [name for name in still if not name.endswith("bias")]
