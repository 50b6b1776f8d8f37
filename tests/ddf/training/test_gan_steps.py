"""Updates of both GANs: their losses in closed form, and trainings that are resumed."""

import math

import _generative
import pytest
import torch
from _support import assert_close
from torch import nn

from ddf.fields import model_files
from ddf.training import gan_steps, training_loop

MODELS = {
    "image": (
        _generative.image_gan,
        lambda model: gan_steps.image_updates(model, _generative.images(), _generative.normals()),
    ),
    "noise": (_generative.noise_gan, lambda model: gan_steps.noise_updates(model, _generative.images())),
}


class _Linear(nn.Module):
    """D(x) = slope * sum(x)."""

    def __init__(self, slope):
        super().__init__()
        self.slope = nn.Parameter(torch.tensor(slope))

    def forward(self, images):
        return self.slope * images.sum(dim=(1, 2, 3))


def test_the_critics_loss_has_its_closed_form():
    critic, real, fake = _Linear(0.5), torch.full((2, 3, 2, 2), 0.1), torch.full((2, 3, 2, 2), -0.2)
    loss, terms = gan_steps.critic_loss(critic, real, fake, 10.0)
    wanted = math.log1p(math.exp(-0.6)) + math.log1p(math.exp(-1.2)) + 10 * 12 * 0.25
    assert float(loss.detach()) == pytest.approx(wanted)
    assert float(terms["penalty"]) == pytest.approx(12 * 0.25)
    loss.backward()
    slopes = -1.2 / (1 + math.exp(0.6)) - 2.4 / (1 + math.exp(1.2)) + 10 * 24 * 0.5
    assert critic.slope.grad is not None
    assert float(critic.slope.grad) == pytest.approx(slopes)
    assert "penalty" not in gan_steps.critic_loss(critic, real.detach(), fake, 0.0)[1]


def test_the_generators_loss_does_not_saturate_and_leaves_the_critic_alone():
    critic, fake = _Linear(2.0), torch.full((1, 3, 2, 2), -0.5, requires_grad=True)
    loss = gan_steps.adversarial_loss(critic, fake)
    assert float(loss.detach()) == pytest.approx(math.log1p(math.exp(12)))
    loss.backward()
    assert critic.slope.grad is None and critic.slope.requires_grad
    assert_close(fake.grad, torch.full_like(fake, -2 / (1 + math.exp(-12))).detach())


@pytest.mark.parametrize("kind", MODELS)
def test_every_update_of_a_step_draws_numbers_of_its_own(kind, monkeypatch):
    make, updates = MODELS[kind]
    turns, own = [], gan_steps.Draw.of
    monkeypatch.setattr(
        gan_steps.Draw, "of", lambda gan, step, turn: turns.append((step, turn)) or own(gan, step, turn)
    )
    steps = updates(make())
    for update in steps:
        update(5)
    assert turns == [(5, turn) for turn in range(len(steps))] and len(steps) > 1


def test_images_are_laid_on_white():
    image = torch.tensor([0.5, 0.0, 1.0, 0.5]).reshape(1, 4, 1, 1)
    assert_close(gan_steps.on_white(image).flatten(), torch.tensor([0.5, 0.0, 1.0]))


@pytest.mark.parametrize("name", MODELS)
def test_critic_and_generator_are_moved_by_their_own_updates(name):
    make, updates_of = MODELS[name]
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
    training_loop.prepare(_generative.LOOP, 2)
    make, updates_of = MODELS[name]
    model = make().train()
    *others, last = updates_of(model)

    def stopping(step):
        if step == stop_at:
            raise KeyboardInterrupt
        return last(step)

    updates = [*others, stopping]
    groups = model.parameter_groups()
    training_loop.fit(model, groups, updates, 3, _generative.LOOP, folder, {"fingerprint": "x"}, name)
    return (folder / model_files.MODEL).read_bytes()


@pytest.mark.parametrize("name", MODELS)
def test_two_runs_agree_and_a_resumed_one_equals_an_uninterrupted_one(name, tmp_path):
    whole = _fit(name, tmp_path / "whole")
    assert whole == _fit(name, tmp_path / "again")
    with pytest.raises(KeyboardInterrupt):
        _fit(name, tmp_path / "parts", stop_at=1)
    assert whole == _fit(name, tmp_path / "parts")


def test_draws_of_updates_differ_and_repeat():
    first, again, other = (gan_steps.Draw.of(_generative.GAN, 3, turn).normal(4) for turn in (0, 0, 1))
    assert_close(first, again)
    assert float((first - other).abs().min()) > 0
