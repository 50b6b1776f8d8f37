"""The steps of the GPU check on the CPU, and on the GPU where there is one (`make test-gpu`)."""

import dataclasses

import pytest
import torch

from bench.fields import gpu_check
from ddf.models import reconstruction_settings
from ddf.training import training_loop

ABSENT = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
DEVICES = ("cpu", pytest.param("cuda", marks=(pytest.mark.gpu, ABSENT)))
LOOP = dataclasses.replace(gpu_check.TRAIN.loop, threads=1, checkpoint_seconds=0.0)
TRAIN = dataclasses.replace(
    gpu_check.TRAIN,
    image_size=32,
    encoder_width=4,
    latent_features=6,
    batch_size=2,
    decoder=dataclasses.replace(gpu_check.TRAIN.decoder, hidden=(16, 12)),
    loop=LOOP,
)
DDF, PCSIREN = reconstruction_settings.DDFConfig(), reconstruction_settings.PCSirenConfig()
SECTIONS = {
    "ddf": dataclasses.replace(DDF, counts=dict.fromkeys(DDF.counts, 6), mask_size=8),
    "pcsiren": dataclasses.replace(PCSIREN, points=20, truth_points=20),
}


def test_differences_are_relative():
    truth = (2.0, torch.tensor([3.0, 0.0, 4.0]).double())
    found = gpu_check.differences((2.02, torch.tensor([3.0, 0.5, 4.0]).double()), truth)
    assert found["loss_relative"] == pytest.approx(0.01)
    assert found["gradient_relative"] == pytest.approx(0.1)
    assert found["gradient_cosine"] == pytest.approx(25 / (5 * 25.25**0.5))


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("model", SECTIONS)
def test_loss_and_gradients_are_those_of_the_cpu(model, device):
    truth = gpu_check.gradients(TRAIN, SECTIONS[model], "cpu")
    assert float(truth[1].norm()) > 0
    exact = gpu_check.differences(gpu_check.gradients(TRAIN, SECTIONS[model], device), truth)
    assert exact["loss_relative"] < 1e-5 and exact["gradient_relative"] < 1e-4


def _trained(model, device, steps, folder, stop_at=None):
    """Weights after so many steps, written to a folder; a stopped training raises KeyboardInterrupt."""
    with gpu_check.placed(device):
        made = gpu_check.trial(TRAIN, SECTIONS[model])

        def loss(step):
            if step == stop_at:
                raise KeyboardInterrupt
            return made.loss(step)

        groups = made.model.parameter_groups()
        training_loop.fit(made.model, groups, loss, steps, LOOP, folder, {"fingerprint": "x"}, model)
        return {name: value.detach().cpu().double() for name, value in made.model.named_parameters()}


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
