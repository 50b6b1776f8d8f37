"""Whole optimisation steps of both models on random data, as those of a training with the same sizes."""

import functools
import time
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ddf.data.batches import category_data, resident
from ddf.data.samples import sample_types
from ddf.fields import model_files
from ddf.geometry import transforms
from ddf.models import loop_config, reconstruction_models, reconstruction_settings
from ddf.training import optimisers, reconstruction_steps, training_loop

STORED = 20_000  # random samples per shape and type to draw from, as many as the paper stores
CLOUD_POINTS = 8_000
Section = reconstruction_settings.DDFConfig | reconstruction_settings.PCSirenConfig


@dataclass(frozen=True)
class Trial:
    """A model, the loss of its steps and its optimiser, all as in a training."""

    model: reconstruction_models.ReconstructionModel
    loss: training_loop.StepLoss
    optimiser: optimisers.Optimiser

    def backward(self, step: int) -> Tensor:
        """Everything of a step but the optimiser: batch, loss and gradients; the loss."""
        loss, _ = self.loss(step)
        self.optimiser.zero_grad()
        loss.backward()
        return loss.detach()


def random_images(count: int, size: int) -> category_data.ImageSet:
    """One image of noise of each of `count` shapes, cameras in the range of the 3D-R2N2 renders."""
    random = np.random.default_rng(0)
    pixels = torch.from_numpy(random.integers(0, 256, (count, 4, size, size), dtype=np.uint8))
    poses = random.uniform((0.0, 0.43, 0.65), (2 * np.pi, 0.52, 0.95), (count, 3)).astype(np.float32)
    ids = [f"random{i}" for i in range(count)]
    return category_data.ImageSet(ids, [0] * count, np.arange(count), pixels, torch.from_numpy(poses))


def random_shapes(count: int) -> category_data.ShapeSet:
    """Clouds of points in the cube, which is twice the size of the shape in the v1 frame."""
    random = np.random.default_rng(1)
    clouds = [torch.from_numpy(random.uniform(-1, 1, (CLOUD_POINTS, 3))).float() for _ in range(count)]
    return category_data.ShapeSet([f"random{i}" for i in range(count)], [transforms.Similarity(2.0)] * count, clouds)


def random_samples(count: int) -> category_data.SampleSet:
    """Samples of every type in their stored form, any code being a valid one."""
    random = np.random.default_rng(2)
    forms = {"positions": (np.int16, 3), "directions": (np.int16, 2), "depth": (np.uint16, 0), "normals": (np.int8, 2)}
    arrays = {}
    for kind in sample_types.KINDS:
        for name, (dtype, width) in forms.items():
            ends, shape = np.iinfo(dtype), (count, STORED, width)[: 3 if width else 2]
            values = random.integers(-ends.max if ends.min else 0, ends.max, shape, dtype=dtype, endpoint=True)
            arrays[f"{kind}.{name}"] = values
    return category_data.SampleSet([arrays], [(0, row) for row in range(count)])


def trial(train: reconstruction_settings.TrainConfig, config: Section) -> Trial:
    """Steps of the model that the section describes, at the sizes of both sections."""
    images, shapes = random_images(train.batch_size, train.image_size), random_shapes(train.batch_size)
    memory = resident.Memory(model_files.device())
    images = memory.images(images)
    if isinstance(config, reconstruction_settings.DDFConfig):
        ddf = reconstruction_models.DDFModel(train, config.field)
        samples = memory.samples(random_samples(train.batch_size))
        loss = functools.partial(reconstruction_steps.ddf_step, ddf, images, shapes, samples, train, config)
        return _trial(ddf, images, train, config.loop(train.loop), loss)
    pcsiren = reconstruction_models.PCSirenModel(train)
    loss = functools.partial(reconstruction_steps.pcsiren_step, pcsiren, images, memory.clouds(shapes), train, config)
    return _trial(pcsiren, images, train, train.loop, loss)


def _trial(
    model: reconstruction_models.ReconstructionModel,
    images: category_data.ImageSet,
    train: reconstruction_settings.TrainConfig,
    loop: loop_config.LoopConfig,
    loss: training_loop.StepLoss,
) -> Trial:
    model.fit_cameras(images)
    model.to(model_files.device()).train()
    groups = model.parameter_groups()
    return Trial(model, loss, optimisers.Optimiser(model, groups, loop))


def now() -> float:
    """Seconds on a clock of its own, after all that the device was asked for is done."""
    if model_files.device().type == "cuda":
        torch.cuda.synchronize()
    return time.perf_counter()
