"""Every listed encoder does what reconstruction, scores of strange images and ONNX files ask of it."""

import dataclasses
import subprocess
import sys

import _models
import pytest
import torch

from ddf.io import onnx_file, onnx_graphs, onnx_parity
from ddf.models import encoders, out_of_distribution, reconstruction_models


def _model(name):
    torch.manual_seed(0)
    train = dataclasses.replace(_models.TRAIN, encoder=name)
    model = reconstruction_models.DDFModel(train, _models.OWN)
    model.camera_head.fit(_models.CAMERAS)
    return model


@pytest.mark.parametrize("name", encoders.ENCODERS)
def test_encoder_learns_a_latent_and_tells_its_stages(name):
    images = torch.rand(6, 4, 32, 32, generator=torch.Generator().manual_seed(0))
    model = _model(name)
    stages, latents, cameras = reconstruction_models.encode_batch(model.eval(), images)
    assert latents.shape == (6, 6) and cameras.shape == (6, 3)
    torch.testing.assert_close(model.shape_encoder(images), latents)
    torch.testing.assert_close(model.shape_encoder.fc(stages[-1]), latents)
    known = out_of_distribution.TrainingStatistics.of(stages)
    assert known is not None and known.score(torch.cat(stages, dim=1)).shape == (6,)
    model.train().shape_encoder(images).square().sum().backward()
    assert all(p.grad is not None and bool(p.grad.isfinite().all()) for p in model.shape_encoder.parameters())


@pytest.mark.parametrize("name", encoders.ENCODERS)
def test_encoder_is_the_same_in_onnx(name):
    graph = onnx_graphs.EncodersGraph(_model(name).eval(), 32)
    onnx_parity.compare(onnx_file.to_onnx(graph, {}), name, graph, (1, 3))


def test_sizes_alone_do_not_load_the_compiler():
    """`torch._dynamo` takes seconds to import; random numbers of the meta device would."""
    script = (
        "import sys, torch; from ddf.models import encoders\n"
        "with torch.device('meta'): encoders.ResNet18(8, 4)\n"
        "assert 'torch._dynamo' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", script], check=True)
