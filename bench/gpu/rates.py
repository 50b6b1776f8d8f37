"""Seconds on the device: whole steps in three precisions, rays of a field, whole clouds."""

import contextlib
import copy
import dataclasses
import statistics
from collections.abc import Callable
from typing import Any, get_args
from unittest import mock

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional
from torch.profiler import ProfilerActivity, profile

from bench.gpu.sizes import EVENLY, Sizes
from bench.lib import measuring
from bench.reconstruction import step_split
from ddf.data.batches import resident
from ddf.fields import cloud_projection, model_files, passes, pddf
from ddf.fields.gpu import compiled_passes
from ddf.geometry.gpu import meshes
from ddf.models import reconstruction_models
from ddf.reconstruction import camera_correction
from ddf.training import training_loop
from ddf_lab.engine import step_cost

WARM_UP = 3  # calls before the timed ones
CHECKED = 8192  # rays whose error is taken
WITHOUT: dict[str, Callable[[], contextlib.AbstractContextManager[Any]]] = {
    "data on the device": lambda: mock.patch.object(resident, "room", lambda device: 0),
    "compiled passes": lambda: mock.patch.object(compiled_passes, "wanted", lambda device: False),
}
PRECISIONS: tuple[passes.Matmul, ...] = get_args(passes.Matmul)


def seconds_of(work: Callable[[], object], repeats: int) -> list[float]:
    """Of calls in turn, each until the device is done."""
    for _ in range(WARM_UP):
        work()
    found = []
    for _ in range(repeats):
        started = step_cost.now()
        work()
        found.append(step_cost.now() - started)
    return found


def on_device(work: Callable[[], object]) -> dict[str, float]:
    """Kernels that one call launches (on a CPU, operators), and the seconds that they take together."""
    cuda = model_files.device().type == "cuda"
    kind = "CUDA" if cuda else "CPU"
    with profile(activities=[ProfilerActivity.CUDA if cuda else ProfilerActivity.CPU]) as profiled:
        work()
        step_cost.now()
    events = [event for event in profiled.events() or [] if event.device_type.name == kind]
    return {"kernels": len(events), "busy_s": sum(event.time_range.elapsed_us() for event in events) / 1e6}


def step_rows(sizes: Sizes) -> list[dict[str, Any]]:
    """A row per model and precision: whole steps, their parts (timed apart, as that waits for each), peak memory."""
    rows = [_step_row(name, precision, sizes) for name in sizes.sections for precision in PRECISIONS]
    rows += [_step_row("ddf", "tf32", sizes, without) for without in WITHOUT]
    if meshes.refusal(model_files.device()) is not None:  # the host would cast, by packages that may be missing
        return rows
    cast = dataclasses.replace(sizes, ddf=dataclasses.replace(sizes.ddf, proposals=sizes.proposals))
    row = _step_row("ddf", "tf32", cast)
    return [*rows, {**row, "what": f"{row['what']}, with proposals"}]


def _step_row(name: str, precision: passes.Matmul, sizes: Sizes, without: str | None = None) -> dict[str, Any]:
    """A row of `step_rows`; without one of `WITHOUT`, to show what that is worth."""
    with WITHOUT[without]() if without else contextlib.nullcontext():
        row = _measured_step(name, precision, sizes)
    return {**row, "what": f"{row['what']}, without {without}"} if without else row


def _measured_step(name: str, precision: passes.Matmul, sizes: Sizes) -> dict[str, Any]:
    loop = dataclasses.replace(sizes.train.loop, matmul=precision)
    train = dataclasses.replace(sizes.train, loop=loop)
    training_loop.prepare(loop)
    trial = step_cost.trial(train, sizes.sections[name])
    numbers = iter(range(10**9))

    def step() -> None:
        trial.backward(next(numbers))
        trial.optimiser.step()

    cuda = model_files.device().type == "cuda"
    if cuda:
        torch.cuda.empty_cache()
        torch.cuda.reset_peak_memory_stats()
    whole = seconds_of(step, sizes.repeats)
    parts = [step_split.one_step(trial, next(numbers)) for _ in range(sizes.repeats)]
    peak = torch.cuda.max_memory_allocated() / 2**30 if cuda else None
    size = {"images": train.batch_size, "parameters": pddf.count_parameters(trial.model)}
    row = measuring.row(f"{name} step, {precision}", size | {"device": model_files.device().type}, whole, {})
    names = [part for part in parts[0] if part not in ("step", "loss")]
    told = {part: statistics.median(each[part] for each in parts) for part in names}
    return {**row, "parts_s": told, "loss": parts[-1]["loss"], "peak_gib": peak, **on_device(step)}


def field_rows(sizes: Sizes) -> list[dict[str, Any]]:
    """A row per field and precision: rays a second of visibility and depth, with the error against float64."""
    rows = []
    for name, hidden in sizes.fields.items():
        torch.manual_seed(0)
        field = pddf.PDDF(sizes.ddf.field.of(dataclasses.replace(sizes.train.decoder, hidden=hidden))).requires_grad_(
            False
        )
        exact = _answer(field.double(), *random_rays(CHECKED, torch.float64, torch.device("cpu")))
        for precision in PRECISIONS:
            torch.set_float32_matmul_precision("high" if precision == "tf32" else "highest")
            dtype, place = torch.bfloat16 if precision == "bfloat16" else torch.float32, model_files.device()
            own = copy.deepcopy(field).to(place, dtype)
            rays = random_rays(sizes.rays, dtype, place)
            seconds = seconds_of(lambda own=own, rays=rays: _answer(own, *rays), sizes.repeats)
            found = _answer(own, *random_rays(CHECKED, dtype, place))
            off = [(a.cpu().double() - b).abs() for a, b in zip(found, exact, strict=True)]
            error = {"visibility_mean": float(off[0].mean()), "depth_median": float(off[1].median())}
            size = {"rays": sizes.rays, "hidden": list(hidden), "device": place.type}
            row = measuring.row(f"field, {name}, {precision}", size, seconds, error)
            rows.append({**row, "million_rays_per_s": sizes.rays / row["median_s"] / 1e6})
    return rows


@torch.inference_mode()
def _answer(field: pddf.PDDF, positions: Tensor, directions: Tensor) -> tuple[Tensor, Tensor]:
    raw = field(positions, directions, None)
    return pddf.visibility(raw), field.depth(raw)


def random_rays(count: int, dtype: torch.dtype, place: torch.device) -> tuple[Tensor, Tensor]:
    """Positions uniform in the box, directions on the sphere: the same whatever type and device."""
    random = torch.Generator().manual_seed(0)
    drawn = torch.randn((count, 6), generator=random, dtype=torch.float64)
    positions, directions = torch.special.ndtr(drawn[:, :3]) * 2 - 1, functional.normalize(drawn[:, 3:], dim=-1)
    return positions.to(place, dtype), directions.to(place, dtype)


def cloud_rows(sizes: Sizes) -> list[dict[str, Any]]:
    """Whole clouds of a field with random weights: projection of all cycles, and the choice of the points."""
    training_loop.prepare(sizes.train.loop)
    torch.manual_seed(0)
    model = reconstruction_models.ddf_model(sizes.train, sizes.ddf.field).to(model_files.device()).eval()
    with torch.no_grad():
        latents = torch.zeros((1, sizes.train.latent_features), device=model_files.device())
        modulations = [values[0] for values in model.modulations(latents)]
    generator = torch.Generator(model_files.device()).manual_seed(0)

    def project() -> list[cloud_projection.ProjectedPoints]:
        return cloud_projection.sample(model.field, modulations, sizes.cloud_points, sizes.cloud, generator)

    def draw() -> None:
        cloud_projection.select(project(), [sizes.cloud_points], sizes.cloud)

    spread = dataclasses.replace(sizes.cloud, **EVENLY)

    def project_evenly() -> list[cloud_projection.ProjectedPoints]:
        return cloud_projection.sample(model.field, modulations, sizes.cloud_points, spread, generator)

    def draw_evenly() -> None:
        cloud_projection.select(project_evenly(), [sizes.cloud_points], spread)

    size = {"points": sizes.cloud_points, "num_directions": sizes.cloud.num_directions, "cycles": sizes.cloud.cycles}
    size |= {"device": model_files.device().type}
    kinds = {"cloud": draw, "cloud as configs/gpu.yaml has it": draw_evenly, "of it the projection": project_evenly}
    rows = [
        {**measuring.row(name, size, seconds_of(work, sizes.repeats), {}), **on_device(work)}
        for name, work in kinds.items()
    ]
    return [*rows, _correction_row(model, sizes)]


def _correction_row(model: reconstruction_models.DDFModel, sizes: Sizes) -> dict[str, Any]:
    """Cameras of as many images at a time as a GPU corrects together, moved to agree with a mask of noise."""
    images = sizes.corrected_images
    data = step_cost.random_images(images, sizes.correction.mask_size)
    model.fit_cameras(data)
    with torch.no_grad():
        latents = torch.zeros((images, sizes.train.latent_features), device=model_files.device())
        modulations = model.modulations(latents)
    alpha, camera = (each.to(latents.device) for each in (data.batch(np.arange(images))[:, 3], data.cameras))
    scale = torch.full((images,), 2.0, device=latents.device)

    def correct() -> None:
        camera_correction.correct_camera(model, modulations, camera, scale, alpha, sizes.correction)

    size = {"images": images, "steps": sizes.correction.steps, "device": latents.device.type}
    name = f"cameras of {images} images corrected"
    return {**measuring.row(name, size, seconds_of(correct, sizes.repeats), {}), **on_device(correct)}
