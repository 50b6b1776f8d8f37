"""Steps on hand-made data on the CPU, and on the GPU where there is one (`make test-gpu`)."""

import contextlib
import dataclasses
import functools
from unittest import mock

import _hand_made
import pytest
import torch
from _support import stopped

from ddf.data.batches import category_data
from ddf.fields import model_files
from ddf.models import line_field, reconstruction_models, reconstruction_settings
from ddf.training import line_steps, reconstruction_steps, training_loop

ABSENT = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
DEVICES = ("cpu", pytest.param("cuda", marks=(pytest.mark.gpu, ABSENT)))
PAPER = reconstruction_settings.TrainConfig()
LOOP = dataclasses.replace(PAPER.loop, threads=1, checkpoint_seconds=0.0)
TRAIN = dataclasses.replace(PAPER, image_size=32, encoder_width=4, latent_features=6, batch_size=2, loop=LOOP)
TRAIN = dataclasses.replace(TRAIN, decoder=dataclasses.replace(PAPER.decoder, hidden=(16, 12)))
DDF, PCSIREN = reconstruction_settings.DDFConfig(), reconstruction_settings.PCSirenConfig()
SECTIONS = {
    "ddf": dataclasses.replace(DDF, counts=dict.fromkeys(DDF.counts, 6), mask_size=8),
    "pcsiren": dataclasses.replace(PCSIREN, points=20, truth_points=20),
    "ddf_image": line_field.LineFieldConfig(places=8, width=16, rays=36),
}


def _trial(model):
    """A network of one of SECTIONS, and the loss of its steps."""
    training_loop.prepare(LOOP)
    section, shapes = SECTIONS[model], _hand_made.shapes()
    memory = category_data.DeviceMemory(model_files.device())
    images = memory.holds("images", _hand_made.images())
    if model == "ddf":
        samples = memory.holds("samples", _hand_made.samples())
        network = reconstruction_models.DDFModel(TRAIN, section.field)
        loss = functools.partial(reconstruction_steps.ddf_step, network, images, shapes, samples, TRAIN, section)
    elif model == "ddf_image":
        samples, network = memory.holds("samples", _hand_made.samples()), line_field.ImageDDFModel(TRAIN, section)
        network.fit_box(shapes)
        loss = functools.partial(line_steps.ddf_image_step, network, images, shapes, samples, TRAIN, section)
    else:
        network, shapes = reconstruction_models.PCSirenModel(TRAIN), memory.holds("clouds", shapes)
        loss = functools.partial(reconstruction_steps.pcsiren_step, network, images, shapes, TRAIN, section)
    network.fit_cameras(images)
    return network.to(model_files.device()).train(), loss


@contextlib.contextmanager
def _placed(device):
    """While this lasts, the package works on this device."""
    try:
        with mock.patch.object(model_files, "device", lambda: torch.device(device)):
            yield
    finally:
        torch.use_deterministic_algorithms(False)  # a training on the CPU asks for them; cuBLAS then refuses to work


def _gradients(model, device):
    """Loss and gradients of the first step, float64, on the CPU."""
    with _placed(device):
        network, loss = _trial(model)
        value = loss(0)[0]
        value.backward()
        found = [p.grad.flatten().cpu().double() for p in network.parameters() if p.grad is not None]
        return float(value.detach()), torch.cat(found)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("model", SECTIONS)
def test_loss_and_gradients_are_those_of_the_cpu(model, device):
    (exact, truth), (loss, own) = _gradients(model, "cpu"), _gradients(model, device)
    assert float(truth.norm()) > 0 and abs(loss - exact) / abs(exact) < 1e-5
    assert float((own - truth).norm() / truth.norm()) < 1e-4


def _trained(model, device, steps, folder, stop_at=None):
    """Weights after so many steps, written to a folder; a stopped training raises KeyboardInterrupt."""
    with _placed(device):
        network, step_loss = _trial(model)
        groups, loss = network.parameter_groups(), stopped(step_loss, stop_at)
        training_loop.fit(network, groups, loss, steps, LOOP, folder, {"fingerprint": "x"}, model)
        return {name: value.detach().cpu().double() for name, value in network.named_parameters()}


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("model", SECTIONS)
def test_steps_and_a_resumed_training_are_those_of_the_cpu(model, device, tmp_path):
    truth = _trained(model, "cpu", 3, tmp_path / "cpu")
    with pytest.raises(KeyboardInterrupt):
        _trained(model, device, 3, tmp_path / "stopped", stop_at=2)
    resumed = _trained(model, device, 3, tmp_path / "stopped")
    rate = LOOP.learning_rate
    for name, value in truth.items():
        # a step of Adam has the size of the rate whatever the gradient, so that rounding of a tiny one may turn it
        assert float((resumed[name] - value).abs().max()) <= (0 if device == "cpu" else 6.1 * rate), name
    moved = torch.cat([(resumed[name] - value).abs().flatten() for name, value in truth.items()])
    assert float((moved > 0.1 * rate).double().mean()) < 0.02
