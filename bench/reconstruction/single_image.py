"""Seconds per image of single-image reconstruction, DDF against PC-SIREN: encoders, clouds and depth pictures.

At the widths of configs/cpu.yaml with the models of `make reproduce-table` where they are there, whose clouds are
scored against the truth, and at those of configs/paper.yaml with random weights, whose clouds mean nothing: time alone.
Clouds are drawn as cpu.yaml says, with N_H = 3 and 1, with fewer directions, and in brief (`brief_clouds`); with random
weights also as paper.yaml says, a tenth of the points, in which its time is linear. Depth of PC-SIREN is what its cloud
can give: the nearest point of each pixel, with holes.
"""

import dataclasses
import functools
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from bench.lib import measuring
from bench.reconstruction import brief_clouds, first_views
from ddf.data.batches import category_data
from ddf.fields import cloud_projection, rendering
from ddf.geometry import cameras, transforms
from ddf.models.reconstruction import inference, reconstruction_models, settings
from ddf_lab.engine import step_cost
from ddf_lab.run import Run

CPU, PAPER = Path("configs/cpu.yaml"), Path("configs/paper.yaml")
CATEGORY, THREADS, IMAGES = "chair", 2, 2
WARM_SECONDS, MOST_SECONDS = 1.0, 4.0  # what takes longer needs no warm-up; what took longer is not repeated
CYCLES, FEWER_DIRECTIONS, DEPTH_SIZES = (3, 1), 4, (64, 256)
PAPER_POINTS = 500  # of clouds drawn as paper.yaml says; `cloud_sampling` draws all of them, and scores them
Pair = tuple[reconstruction_models.DDFModel, reconstruction_models.PCSirenModel]


@dataclasses.dataclass(frozen=True)
class Scene:
    """What a set of rows is measured on.

    views: what clouds are scored against; None for random weights.
    """

    name: str
    models: Pair
    section: settings.PointcloudsConfig
    images: category_data.ImageSet
    field_scales: list[float]
    views: first_views.Views | None


def read(run: Run) -> tuple[settings.TrainConfig, Pair, settings.PointcloudsConfig]:
    """The training section, both models freshly initialised, and how clouds are drawn."""
    train = run.section(settings.TrainConfig)
    torch.manual_seed(0)
    ddf = reconstruction_models.ddf_model(train, run.section(settings.DDFConfig).field)
    models = (ddf.eval(), reconstruction_models.pcsiren_model(train).eval())
    return train, models, run.section(settings.PointcloudsConfig)


def random_scene(run: Run) -> Scene:
    """Random weights on random images."""
    train, models, section = read(run)
    images = step_cost.random_images(IMAGES, train.image_size)
    for model in models:
        model.camera_head.fit(images.cameras)
    return Scene(f"{run.file.name}, random weights", models, section, images, [2.0] * IMAGES, None)


def trained_scene(run: Run) -> Scene:
    """The experiment's own models on the first views of its first test shapes."""
    _, models, section = read(run)
    views = first_views.read(run, CATEGORY, IMAGES, dict(zip(("train_ddf", "train_pcsiren"), models, strict=True)))
    name = f"{run.file.name}, trained, {CATEGORY}"
    return Scene(name, models, section, views.images, views.field_scales, views)


def per_image(work: Callable[[int], Any]) -> tuple[list[float], list[Any]]:
    """Seconds and results of one image after another, as many as the time allows, at least one."""
    started = time.perf_counter()
    results = [work(0)]
    seconds = [time.perf_counter() - started]
    if seconds[0] < WARM_SECONDS:
        results, seconds = [], []
    while len(seconds) < IMAGES and sum(seconds) < MOST_SECONDS:
        started = time.perf_counter()
        results.append(work(len(seconds)))
        seconds.append(time.perf_counter() - started)
    return seconds, results


def score(scene: Scene, clouds: list[Tensor]) -> dict[str, float]:
    """Mean errors of the clouds of the first images; nothing for random weights."""
    if scene.views is None:
        return {}
    found = [scene.views.scores(image, points.numpy()) for image, points in enumerate(clouds)]
    return {name: statistics.fmean(score[name] for score in found) for name in found[0]}


def splat(points: Tensor, camera: Tensor, field_scale: float, size: int) -> Tensor:
    """Depth along the camera's axis of the nearest point in each pixel, inf where there is none."""
    cloud = points * (transforms.BENCHMARK_FROM_V1 / field_scale)
    extrinsics = cameras.extrinsics(*camera)
    z_depth = -cameras.to_camera(cloud, *extrinsics)[..., 2]
    column, row = (value * (size / cameras.IMAGE_SIZE) for value in cameras.project(cloud, *extrinsics))
    inside = (column >= 0) & (column < size) & (row >= 0) & (row < size) & (z_depth > 0)
    pixel = (row[inside].long() * size + column[inside].long()).clamp(0, size * size - 1)
    depth = torch.full((size * size,), torch.inf).scatter_reduce(0, pixel, z_depth[inside], "amin")
    return depth.reshape(size, size)


def changed(cloud: cloud_projection.CloudConfig, **values: Any) -> cloud_projection.CloudConfig:
    """The same way of drawing clouds with other values, of those that it has."""
    known = {field.name for field in dataclasses.fields(cloud)}
    return dataclasses.replace(cloud, **{name: value for name, value in values.items() if name in known})


def variants() -> dict[cloud_projection.CloudConfig, str]:
    """Ways of drawing a cloud, and what to call them: as cpu.yaml says, with fewer directions, in brief."""
    cloud = Run.read(CPU).section(settings.PointcloudsConfig).cloud
    found = {changed(cloud, cycles=cycles): f"as {CPU.name}" for cycles in CYCLES}
    found.setdefault(changed(cloud, num_directions=FEWER_DIRECTIONS), f"as {CPU.name}, fewer directions")
    found.setdefault(changed(cloud, **brief_clouds.IN_BRIEF), f"as {CPU.name}, in brief")
    return found


@torch.no_grad()
def measure(scene: Scene) -> list[dict[str, Any]]:
    """All rows of one scene."""
    ddf, pcsiren = scene.models
    count = scene.section.large
    rows = []

    def add(what: str, size: dict[str, Any], work: Callable[[int], Any], clouds: bool = False) -> None:
        seconds, results = per_image(work)
        error = score(scene, results) if clouds else {}
        rows.append({**measuring.row(f"{what}; {scene.name}", size, seconds, error), "images": len(seconds)})

    def encode(model: reconstruction_models.ReconstructionModel, image: int) -> tuple[Tensor, Tensor]:
        batch = scene.images.batch(np.array([image]))
        return model.shape_encoder(batch), model.camera_head(model.camera_encoder(batch))[0]

    side = scene.images.images[0].shape[-1]
    for name, model in (("DDF", ddf), ("PC-SIREN", pcsiren)):
        add(f"{name} encoders", {"image_size": side}, lambda image, model=model: encode(model, image))
    latents = [[encode(model, image)[0] for image in range(IMAGES)] for model in scene.models]
    modulations = [[m[0] for m in ddf.modulations(latent)] for latent in latents[0]]

    def decode(image: int) -> Tensor:
        generator = torch.Generator().manual_seed(image)
        inputs = inference.cube_points(count, scene.section.pcsiren_inputs, generator)
        return pcsiren.decoder(inputs[None], latents[1][image])[0]

    add("PC-SIREN cloud", {"points": count}, decode, clouds=True)

    def draw(image: int, setting: cloud_projection.CloudConfig, points: int = count) -> Tensor:
        generator = torch.Generator().manual_seed(image)
        cycles = cloud_projection.sample(ddf.field, modulations[image], points, setting, generator)
        return cloud_projection.select(cycles, [points], setting)[0]

    for setting, name in variants().items():
        work = functools.partial(draw, setting=setting)
        add(f"DDF cloud {name}", {"points": count, **dataclasses.asdict(setting)}, work, clouds=True)
    if scene.views is None:
        paper = Run.read(PAPER).section(settings.PointcloudsConfig).cloud
        size = {"points": PAPER_POINTS, **dataclasses.asdict(paper)}
        add(f"DDF cloud as {PAPER.name}", size, functools.partial(draw, setting=paper, points=PAPER_POINTS))
    for pixels in DEPTH_SIZES:

        def depth(image: int, pixels: int = pixels) -> Tensor:
            camera, scale = scene.images.cameras[image], torch.tensor(scene.field_scales[image])
            return rendering.render(ddf.field, modulations[image], camera, scale, pixels, ("depth",))[0]["depth"]

        def points_depth(image: int, pixels: int = pixels) -> Tensor:
            return splat(decode(image), scene.images.cameras[image], scene.field_scales[image], pixels)

        add("DDF depth", {"pixels": pixels}, depth)
        add("PC-SIREN depth, cloud drawn as points", {"pixels": pixels, "points": count}, points_depth)
    return rows


def main() -> None:
    """Measure both widths."""
    torch.set_num_threads(THREADS)
    cpu = Run.read(CPU)
    first = trained_scene(cpu) if first_views.trained(cpu, CATEGORY) else random_scene(cpu)
    scenes = (first, random_scene(Run.read(PAPER)))
    measuring.write("single_image", THREADS, [row for scene in scenes for row in measure(scene)])
