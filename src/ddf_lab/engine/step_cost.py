"""Whole optimisation steps of both models on random data, to be timed before any data set is there.

The arithmetic of a step is the same whatever the images and samples are, so its seconds and memory are those of a
training with the same sizes on this machine.
"""

import functools
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch

from ddf.data.batches import category_data, resident
from ddf.data.samples import sample_types
from ddf.fields import model_files
from ddf.geometry import mesh_io, raycast, transforms
from ddf.models import loop_config, reconstruction_models, reconstruction_settings
from ddf.training import optimisers, proposed_rays, training_loop, training_steps

STORED = 20_000  # random samples per shape and type to draw from, as many as the paper stores
CLOUD_POINTS, FACES = 8_000, 10_000
MOST_POINTS, MOST_IMAGES = 40_000, 8  # of a trial that is scaled up: about 3 GiB at the paper's widths
REPEATS = 3
Section = reconstruction_settings.DDFConfig | reconstruction_settings.PCSirenConfig


@dataclass(frozen=True)
class Trial:
    """A model, the loss of its steps and its optimiser, all as in a training."""

    model: reconstruction_models.ReconstructionModel
    loss: training_loop.StepLoss
    optimiser: optimisers.Optimiser

    def backward(self, step: int) -> None:
        """Everything of a step but the optimiser: batch, loss and gradients."""
        loss, _ = self.loss(step)
        self.optimiser.zero_grad()
        loss.backward()


@dataclass(frozen=True)
class StepCost:
    """Seconds of a step of `batch_size` images: those of the optimiser, and all others, measured at `trial_images`."""

    batch_size: int
    trial_images: int
    trial_seconds: float
    optimiser_seconds: float

    @property
    def seconds(self) -> float:
        """Of a whole step; what depends on the batch is scaled from the trial in proportion to the images."""
        return self.optimiser_seconds + self.trial_seconds * self.batch_size / self.trial_images


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


def random_scene() -> raycast.Scene:
    """Small triangles in the cube, as many as a training mesh has."""
    random = np.random.default_rng(3)
    corners = np.clip(random.uniform(-1, 1, (FACES, 1, 3)) + random.normal(0, 0.02, (FACES, 3, 3)), -1, 1)
    return raycast.Scene(mesh_io.Mesh(corners.reshape(-1, 3), np.arange(3 * FACES).reshape(-1, 3)))


def trial(train: reconstruction_settings.TrainConfig, config: Section) -> Trial:
    """Steps of the model that the section describes, at the sizes of both sections."""
    images, shapes = random_images(train.batch_size, train.image_size), random_shapes(train.batch_size)
    memory = resident.Memory(model_files.device())
    images = memory.images(images)
    if isinstance(config, reconstruction_settings.DDFConfig):
        ddf, propose = reconstruction_models.ddf_model(train, config.field), None
        samples = memory.samples(random_samples(train.batch_size))
        if config.proposals is not None:
            scenes = [random_scene()] * train.batch_size
            propose = proposed_rays.Proposer(shapes, scenes, config.proposals)
        given = (ddf, images, shapes, samples, train, config)
        loss = functools.partial(training_steps.ddf_step, *given, propose=propose)
        return _trial(ddf, images, train, config.loop(train.loop), loss)
    pcsiren = reconstruction_models.pcsiren_model(train)
    loss = functools.partial(training_steps.pcsiren_step, pcsiren, images, memory.clouds(shapes), train, config)
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
    return Trial(model, loss, optimisers.of(model, groups, loop))


def measure(train: reconstruction_settings.TrainConfig, config: Section) -> StepCost:
    """Seconds of a step on this machine: medians of a few at no more than `MOST_POINTS` points and `MOST_IMAGES`."""
    images = min(train.batch_size, max(2, min(MOST_IMAGES, MOST_POINTS // _points_per_image(config))))
    tried = trial(replace(train, batch_size=images), config)
    tried.backward(0)
    tried.optimiser.step()
    rest = [_seconds(lambda step=step: tried.backward(step)) for step in range(1, 1 + REPEATS)]
    optimiser = [_seconds(tried.optimiser.step) for _ in range(REPEATS)]
    return StepCost(train.batch_size, images, statistics.median(rest), statistics.median(optimiser))


def _points_per_image(config: Section) -> int:
    if isinstance(config, reconstruction_settings.PCSirenConfig):
        return config.points
    proposed = 0 if config.proposals is None else config.proposals.points * config.proposals.directions
    return sum(config.counts.values()) + proposed + (config.mask_pixels or config.mask_size**2)


def _seconds(work: Callable[[], object]) -> float:
    started = now()
    work()
    return now() - started


def now() -> float:
    """Seconds on a clock of its own, after all that the device was asked for is done."""
    if model_files.device().type == "cuda":
        torch.cuda.synchronize()
    return time.perf_counter()
