"""Small settings, networks, points and model files for several tests."""

import dataclasses
from typing import Literal

import numpy as np
import torch
from torch import nn

from ddf.core import storage
from ddf.data.samples import sample_batch, sample_types
from ddf.fields import losses, model_files, pddf, shape_field
from ddf.geometry import transforms
from ddf.models import line_field, loop_config, reconstruction_models, reconstruction_settings

LOOP = loop_config.LoopConfig(1e-3, "constant", 0, None, 1, 0, 1, 100.0)
FIELD = pddf.PDDFConfig((24, 16, 16), 3.0, 1.0, "softplus", 20.0)
TRAIN = reconstruction_settings.TrainConfig(32, "resnet", 4, 6, FIELD.layout(), 4, LOOP)
WEIGHTS = losses.LossWeights()
OWN = reconstruction_settings.FieldConfig("softplus", 20.0)
DDF = reconstruction_settings.DDFConfig(OWN, 1, None, dict.fromkeys(sample_types.ORDER, 2), WEIGHTS, 10.0, 16, 20)
PCSIREN = reconstruction_settings.PCSirenConfig(1, 8, 8)
LINE = line_field.LineFieldConfig(places=8, width=16)
LOWER, UPPER = np.array([-1.0, -0.5, -0.8]), np.array([1.0, 0.5, 0.8])
FRAME = transforms.Similarity(0.02, np.eye(3), np.array([-4.0, 0.3, 1.0]))  # of a mesh 100 units long, off the origin
CAMERAS = torch.tensor([[0.1, 0.45, 0.7], [3.0, 0.5, 0.8], [6.0, 0.47, 0.9]])


def field(activation: pddf.DepthActivation = "softplus") -> pddf.PDDF:
    torch.manual_seed(0)
    return pddf.PDDF(dataclasses.replace(FIELD, depth_activation=activation)).requires_grad_(False)


def points(count, seed=0):
    generator = torch.Generator().manual_seed(seed)
    positions = torch.rand((count, 3), generator=generator) * 2 - 1
    return positions, nn.functional.normalize(torch.randn((count, 3), generator=generator), dim=-1)


def batch(counts: dict[str, int], shapes: int = 2, dtype: torch.dtype = torch.float64) -> sample_batch.SampleBatch:
    """Random oriented points, of which about three in five see something."""
    generator, count = torch.Generator().manual_seed(5), sum(counts.values())
    uniform = torch.rand(shapes, count, 5, generator=generator, dtype=torch.float64)
    vectors = torch.randn(2, shapes, count, 3, generator=generator, dtype=torch.float64)
    directions, normals = nn.functional.normalize(vectors, dim=-1)
    given = (2 * uniform[..., :3] - 1, directions, (uniform[..., 3] > 0.4).double(), 2 * uniform[..., 4], normals)
    return sample_batch.SampleBatch(*(values.to(dtype) for values in given), counts=counts)


class BallField(pddf.PDDF):
    """A ball's visibility, as logits proportional to how deep a ray passes; its centre may be the modulation's first.

    So its mask is known for every camera.
    """

    def __init__(self, radius: float = 0.7, slope: float = 40, centre: torch.Tensor | None = None) -> None:
        super().__init__(FIELD)
        self.radius, self.slope, self.centre = radius, slope, torch.zeros(3) if centre is None else centre

    def forward(self, positions, directions, modulations=None):
        away = positions - (modulations[0][..., :3] if modulations else self.centre)
        closest = away - (away * directions).sum(-1, keepdim=True) * directions
        logit = self.slope * (self.radius - (closest + 1e-9).norm(dim=-1))
        zero = torch.zeros_like(logit)
        return torch.stack((zero, zero, zero, logit), dim=-1)


def _made(kind, train: reconstruction_settings.TrainConfig, *own):
    """With random weights, and the cameras that it knows."""
    torch.manual_seed(0)
    made = kind(train, *own).eval()
    made.camera_head.fit(CAMERAS)
    return made


def ddf_model(azimuth: Literal["angle", "sincos"] = "angle", told: bool = False):
    train = dataclasses.replace(TRAIN, azimuth=azimuth, told=told)
    return _made(reconstruction_models.DDFModel, train, DDF.field)


def of_field(config: pddf.PDDFConfig, latent_features: int, width: int, azimuth: Literal["angle", "sincos"] = "angle"):
    """Fresh models of both kinds, the DDF's with this field."""
    train = reconstruction_settings.TrainConfig(
        latent_features=latent_features, encoder_width=width, decoder=config.layout(), azimuth=azimuth
    )
    own = (config.depth_activation, config.depth_sharpness, config.direction_scale)
    field_config = reconstruction_settings.FieldConfig(*own)
    return reconstruction_models.DDFModel(train, field_config), reconstruction_models.PCSirenModel(train)


def pcsiren_model():
    return _made(reconstruction_models.PCSirenModel, TRAIN)


def line_model():
    """With image features; some parts are hit."""
    made = _made(line_field.ImageDDFModel, TRAIN, LINE).requires_grad_(False)
    made.decoder.head.bias[0] = 1.0
    return made


def write_shape_field(folder, **changes):
    """A field file as `ddf fit` writes it, with changes of its record; returns its folder."""
    record = {"fingerprint": "x", "seed": 0, "sources": {}, **shape_field.description(FIELD, LOWER, UPPER, FRAME)}
    storage.save_tensors(folder / model_files.MODEL, dict(field().state_dict()), record | changes)
    return folder


def write_model(folder, kind="ddf"):
    """A model file as the training stages write it; returns its folder."""
    makers = {"ddf": (DDF, ddf_model), "pcsiren": (PCSIREN, pcsiren_model), "ddf_image": (LINE, line_model)}
    section, model = makers[kind][0], makers[kind][1]()
    record = {"kind": kind, "train": dataclasses.asdict(TRAIN), "section": dataclasses.asdict(section)}
    storage.save_tensors(folder / model_files.MODEL, dict(model.state_dict()), record)
    return folder
