"""One GPU: steps of two models and rays of a field at the paper's sizes, by precision.

Steps are those of configs/paper.yaml on random data, whole; that they are the CPU's is for `make test-gpu`. Errors of a
field are against the CPU in float64.
"""

import copy
import dataclasses
import functools
from typing import Literal

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from bench.lib import measuring
from ddf.core import checks
from ddf.data import packing
from ddf.data.batches import category_data
from ddf.data.samples import sample_types
from ddf.fields import model_files, pddf
from ddf.geometry import transforms
from ddf.models import loop_config, reconstruction_models, reconstruction_settings
from ddf.training import optimisers, reconstruction_steps, training_loop

TRAIN = reconstruction_settings.TrainConfig()
Section = reconstruction_settings.DDFConfig | reconstruction_settings.PCSirenConfig
SECTIONS: dict[str, Section] = {
    "ddf": reconstruction_settings.DDFConfig(),
    "pcsiren": reconstruction_settings.PCSirenConfig(),
}
FIELDS = {"paper's widths": TRAIN.decoder.hidden, "4 x 192": (192,) * 4}
PRECISIONS: tuple[Literal["float32", "tf32"], ...] = ("float32", "tf32")
REPEATS, RAYS, CHECKED = 8, 2**20, 8192  # CHECKED: rays whose error is taken
STORED, CLOUD_POINTS = 20_000, 8_000  # random samples of a shape and type, and points of its cloud


Trial = tuple[reconstruction_models.ReconstructionModel, training_loop.StepLoss, loop_config.LoopConfig]


def trial(train: reconstruction_settings.TrainConfig, section: Section) -> Trial:
    """A model of both sections' sizes, the loss of its steps on random data, and their loop, as in a training."""
    training_loop.prepare(train.loop)
    count, size, random = train.batch_size, train.image_size, np.random.default_rng(0)
    ids = [f"random{number}" for number in range(count)]
    pixels = torch.from_numpy(random.integers(0, 256, (count, 4, size, size), dtype=np.uint8))
    poses = random.uniform((0.0, 0.43, 0.65), (2 * np.pi, 0.52, 0.95), (count, 3)).astype(np.float32)  # as 3D-R2N2's
    images = category_data.ImageSet(ids, [0] * count, np.arange(count), pixels, torch.from_numpy(poses))
    clouds = [random.uniform(-0.5, 0.5, (CLOUD_POINTS, 3)) for _ in ids]
    shapes = category_data.ShapeSet.of(ids, [transforms.Similarity(2.0)] * count, clouds)
    memory = category_data.DeviceMemory(model_files.device())
    images = memory.holds("images", images)
    if isinstance(section, reconstruction_settings.DDFConfig):
        model, loop = reconstruction_models.DDFModel(train, section.field), section.loop(train.loop)
        samples = memory.holds("samples", random_samples(count))
        loss = functools.partial(reconstruction_steps.ddf_step, model, images, shapes, samples, train, section)
    else:
        model, loop = reconstruction_models.PCSirenModel(train), train.loop
        shapes = memory.holds("clouds", shapes)
        loss = functools.partial(reconstruction_steps.pcsiren_step, model, images, shapes, train, section)
    model.fit_cameras(images)
    model.to(model_files.device()).train()
    return model, loss, loop


def random_samples(count: int) -> category_data.SampleSet:
    """Samples of every type of so many shapes in their stored form, any code being a valid one."""
    size = (count, len(sample_types.KINDS) * STORED, packing.RECORD)
    records = np.random.default_rng(2).integers(-32767, 32767, size, np.int16, endpoint=True)
    return category_data.SampleSet(torch.from_numpy(records), sample_types.each(STORED))


def step_rows(name: str) -> measuring.Rows:
    """A row per precision of a model."""
    for precision in PRECISIONS:
        train = dataclasses.replace(TRAIN, loop=dataclasses.replace(TRAIN.loop, matmul=precision))
        model, loss, loop = trial(train, SECTIONS[name])
        optimiser = optimisers.Optimiser(model, model.parameter_groups(), loop)
        torch.cuda.reset_peak_memory_stats()
        step = functools.partial(_step, model, loss, optimiser)
        (seconds,) = measuring.interleaved({name: step}, REPEATS).values()
        size = {"gpu": torch.cuda.get_device_name(), "images": TRAIN.batch_size}
        size["peak_gib"] = round(torch.cuda.max_memory_allocated() / 2**30, 2)
        yield measuring.row(f"{name} step, {precision}", size, seconds, {})


def _step(model: torch.nn.Module, loss: training_loop.StepLoss, optimiser: optimisers.Optimiser) -> None:
    model.zero_grad()
    loss(0)[0].backward()
    optimiser.step()
    torch.cuda.synchronize()


def field_rows(name: str) -> measuring.Rows:
    """A row per precision of a field: visibility and depth of many rays, with the error against float64."""
    torch.manual_seed(0)
    section = reconstruction_settings.DDFConfig().field
    field = pddf.PDDF(section.of(dataclasses.replace(TRAIN.decoder, hidden=FIELDS[name]))).requires_grad_(False)
    exact = _answer(copy.deepcopy(field).double(), *random_rays(CHECKED, torch.float64, "cpu"))
    for precision in PRECISIONS:
        torch.set_float32_matmul_precision("high" if precision == "tf32" else "highest")
        own = copy.deepcopy(field).to("cuda")
        ask = functools.partial(_answer, own, *random_rays(RAYS, torch.float32, "cuda"))
        (seconds,) = measuring.interleaved({name: ask}, REPEATS).values()
        found = _answer(own, *random_rays(CHECKED, torch.float32, "cuda"))
        off = [(a.cpu().double() - b).abs() for a, b in zip(found, exact, strict=True)]
        error = {"visibility_mean": float(off[0].mean()), "depth_median": float(off[1].median())}
        size = {"gpu": torch.cuda.get_device_name(), "rays": RAYS}
        row = measuring.row(f"field, {name}, {precision}", size, seconds, error)
        yield {**row, "million_rays_per_s": RAYS / row["median_s"] / 1e6}


@torch.inference_mode()
def _answer(field: pddf.PDDF, positions: Tensor, directions: Tensor) -> tuple[Tensor, Tensor]:
    raw = field(positions, directions, None)
    found = pddf.visibility(raw), field.depth(raw)
    torch.cuda.synchronize()
    return found


def random_rays(count: int, dtype: torch.dtype, device: str) -> tuple[Tensor, Tensor]:
    """Positions uniform in the box, directions on the sphere: the same whatever type and device."""
    random = torch.Generator().manual_seed(0)
    drawn = torch.randn((count, 6), generator=random, dtype=torch.float64)
    positions, directions = torch.special.ndtr(drawn[:, :3]) * 2 - 1, functional.normalize(drawn[:, 3:], dim=-1)
    return positions.to(device, dtype), directions.to(device, dtype)


def main() -> measuring.Rows:
    """Steps of both models, then fields; InputError without a GPU."""
    if not torch.cuda.is_available():
        raise checks.InputError(f"torch {torch.__version__} finds no CUDA device")
    return (
        row for rows, names in ((step_rows, SECTIONS), (field_rows, FIELDS)) for name in names for row in rows(name)
    )
