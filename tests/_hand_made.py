"""Settings and hand-made data for steps and reconstructions of small models."""

import _models
import numpy as np
import torch

from ddf.data import packing
from ddf.data.batches import category_data
from ddf.data.samples import sample_types
from ddf.fields import cloud_projection
from ddf.geometry import transforms
from ddf.models import line_field, reconstruction_settings

TRAIN = _models.TRAIN
PLACES = [(0, 0), (0, 1), (1, 0)]  # of the shapes: shard, and row in it
COUNTS = {"E": 3, "U": 6, "A": 6, "B": 4, "S": 4, "T": 4, "O": 4, "A+": 5}
DDF = reconstruction_settings.DDFConfig(
    reconstruction_settings.FieldConfig("softplus", 20.0), 5, 2e-3, COUNTS, _models.WEIGHTS, 10.0, 16, 20
)
PCSIREN = reconstruction_settings.PCSirenConfig(5, 50, 70)
CLOUD = cloud_projection.CloudConfig(8, 2, 0.0, (), None, 0.05, 0.05)
POINTCLOUDS = reconstruction_settings.PointcloudsConfig(
    CLOUD,
    reconstruction_settings.CorrectionConfig(2, 0.05, 16, reconstruction_settings.CAMERA_NUMBERS),
    60,
    30,
    None,
    2,
    12,
)


def images(count=6, shapes=3):
    generator = torch.Generator().manual_seed(0)
    images = (torch.rand(count, 4, 32, 32, generator=generator) * 255).to(torch.uint8)
    images[:, 3, :10], images[:, 3, 22:], images[:, 3, :, :10], images[:, 3, :, 22:] = 0, 0, 0, 0  # rays miss there
    poses = torch.rand(count, 3, generator=generator) * torch.tensor([6.0, 0.1, 0.3]) + torch.tensor([0.0, 0.45, 0.65])
    ids = [f"shape{i}" for i in range(shapes)]
    return category_data.ImageSet(ids, [i % 5 for i in range(count)], np.arange(count) % shapes, images, poses)


def shapes(count=3):
    random = np.random.default_rng(0)
    frames = [transforms.Similarity(2.0 + i) for i in range(count)]
    clouds = [frame.inverse().apply(random.uniform(-1, 1, (80, 3))) for frame in frames]
    return category_data.ShapeSet.of([f"shape{i}" for i in range(count)], frames, clouds)


def shards(shapes=3, stored=40):
    """Every sample of shape i has depth (i + 1)/4, so that a mix-up of shapes shows."""
    random = np.random.default_rng(1)
    arrays = {}
    for kind in sample_types.KINDS:
        directions = random.standard_normal((shapes, stored, 3))
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        depth = np.repeat((np.arange(shapes) + 1)[:, None] / 4.0, stored, axis=1)
        depth[:, ::4] = np.inf
        arrays[f"{kind}.positions"] = packing.encode_positions(random.uniform(-1, 1, (shapes, stored, 3)))
        arrays[f"{kind}.directions"] = packing.encode_unit(directions, np.int16)
        arrays[f"{kind}.depth"] = packing.encode_depth(depth)
        arrays[f"{kind}.normals"] = packing.encode_unit(-directions, np.int8)
    return [{name: values[rows] for name, values in arrays.items()} for rows in (slice(0, 2), slice(2, None))]


def line_model(own=_models.LINE):
    """With image features, fresh, and with the cameras of the images."""
    torch.manual_seed(0)
    model = line_field.ImageDDFModel(TRAIN, own).eval().requires_grad_(False)
    model.fit_cameras(images())
    return model


def assert_learns(model, loss_of):
    """The loss reaches every parameter, and 30 steps of Adam lower it."""
    torch.manual_seed(0)
    optimiser, losses = torch.optim.Adam(model.train().requires_grad_().parameters(), lr=3e-3), []
    for _ in range(31):
        optimiser.zero_grad()
        losses.append(loss_of())
        losses[-1].backward()
        if len(losses) == 1:
            assert [name for name, p in model.named_parameters() if p.grad is None or not p.grad.any()] == []
        optimiser.step()
    assert losses[-1] < (0.8 if losses[0] > 0 else 1) * losses[0]


def samples():
    return category_data.SampleSet.of(shards(), PLACES)
