"""CPU seconds and bytes per unit of the work that is a map, at the settings of configs/paper.yaml, on synthetic shapes.

CPU seconds are those of all threads of this process, so that they do not depend on what else the machine does.
"""

import dataclasses
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch

from ddf.data import dataset, mesh_preparation, sampling, shapenet, true_clouds
from ddf.data.batches import category_data
from ddf.data.synthetic import write
from ddf.geometry import mesh_io, neighbours
from ddf.metrics import metrics
from ddf.models.reconstruction import camera_correction, inference, reconstruction_models, settings
from ddf_lab.evaluation import scoring
from ddf_lab.run import Run

CATEGORIES = ("chair", "plane", "car")
CLOUD_POINTS = 200  # of the L points of a cloud: its time is linear in them
CORRECTION_STEPS = 4  # of those that correct a camera
Result = TypeVar("Result")


def timed(work: Callable[[], Result]) -> tuple[Result, float]:
    """What the work gives, and its CPU seconds."""
    started = time.process_time()
    result = work()
    return result, time.process_time() - started


def prepare(run: Run, folder: Path) -> dict[str, dict[str, Any]]:
    """One shape of each category through the stages `meshes` and `samples`: mean CPU seconds and bytes per shape."""
    sections = {
        "meshes": run.section(mesh_preparation.MeshesConfig),
        "samples": run.section(sampling.SamplesConfig),
    }
    seconds: dict[str, list[float]] = {name: [] for name in sections}
    sizes: dict[str, list[int]] = {name: [] for name in sections}
    for category in CATEGORIES:
        path = folder / f"{category}.obj"
        path.write_text(write.obj_text(write.make_shape(0, category, 0)))
        rng = np.random.default_rng(0)
        raw = mesh_io.load(path)
        prepared, spent = timed(lambda raw=raw, rng=rng: mesh_preparation.prepare(raw, sections["meshes"], rng))
        seconds["meshes"].append(spent)
        sizes["meshes"].append(len(mesh_io.ply_bytes(prepared.mesh)))

        def extract(path: Path = path, mesh: mesh_io.Mesh = prepared.mesh, category: str = category, rng=rng):
            arrays, _ = sampling.extract(mesh, sections["samples"], category, "0")
            return [
                *arrays.values(),
                *vars(true_clouds.draw(mesh_io.load(path), sections["samples"].cloud_points, rng)).values(),
            ]

        arrays, spent = timed(extract)
        seconds["samples"].append(spent)
        sizes["samples"].append(sum(array.nbytes for array in arrays))
    return {name: {"cpu_s": statistics.mean(seconds[name]), "bytes": statistics.mean(sizes[name])} for name in sections}


def check(index_path: Path, category: str, count: int) -> float:
    """CPU seconds per shape of checking meshes, metadata and images, as stage `dataset` does with real data."""
    data = shapenet.Dataset.open(index_path)
    entry = data.category(category)
    names = [shape.id for shape in entry.shapes[:count]]
    _, spent = timed(lambda: [dataset.check_shape(data.root, entry.synset, name, 5) for name in names])
    return spent / len(names)


def reconstruct(run: Run) -> dict[str, Any]:
    """CPU seconds of one test image in stage `pointclouds`, from a DDF of full size with random weights.

    Clouds of few points and few steps of correction are measured, and taken to be linear in both.
    """
    train = run.section(settings.TrainConfig)
    section = run.section(settings.PointcloudsConfig)
    model = reconstruction_models.ddf_model(train, run.section(settings.DDFConfig).field).eval()
    pixels = torch.zeros((1, 4, train.image_size, train.image_size), dtype=torch.uint8)
    cameras = torch.tensor([[0.5, 0.45, 0.8]])
    model.camera_head.fit(cameras.repeat(2, 1) + torch.tensor([[0.0], [0.1]]))
    images = category_data.ImageSet(["a"], [0], np.zeros(1, dtype=int), pixels, cameras)

    few = dataclasses.replace(
        section,
        large=CLOUD_POINTS,
        small=1,
        rendered=0,
        correction=dataclasses.replace(section.correction, steps=1),
        shape_correction=None,
    )
    some = dataclasses.replace(section.correction, steps=CORRECTION_STEPS)
    _, latents, predicted = inference.encode(model, images)
    alpha, scale = images.alpha(np.zeros(1, dtype=int), some.mask_size), torch.ones(1)
    modulations = [m.detach() for m in model.modulations(latents)]
    _, spent = timed(lambda: camera_correction.correct_camera(model, modulations, predicted, scale, alpha, some))
    step = spent / CORRECTION_STEPS
    _, spent = timed(lambda: inference.reconstruct_ddf(model, images, few, ""))
    cloud = (spent - step) / CLOUD_POINTS
    return {
        "cpu_s": cloud * section.large + step * section.correction.steps,
        "cloud_cpu_s_per_point": cloud,
        "correction_cpu_s_per_step": step,
        "parameters": sum(p.numel() for p in model.parameters()),
        "features": model.shape_encoder.fc.in_features,
        "large": section.large,
        "small": section.small,
    }


def evaluate(run: Run, cloud_points: int) -> dict[str, float]:
    """CPU seconds of one comparison of a cloud L with a truth, and of one pair of shapes that the oracle row ranks."""
    section = run.section(scoring.EvaluateConfig)
    large = run.section(settings.PointcloudsConfig).large
    shapes = [write.make_shape(0, category, 0) for category in CATEGORIES]
    rng = np.random.default_rng(0)
    points = [
        true_clouds.draw(mesh_io.Mesh(s.vertices, s.triangles), cloud_points, rng).points.astype(float) for s in shapes
    ]
    case = [
        timed(lambda one=one, two=two: metrics.compare_clouds(one[:large], two, section.tau_sq))[1]
        for one, two in zip(points, points[1:] + points[:1], strict=True)
    ]
    trees = [neighbours.Neighbours(rng.permutation(cloud)[: section.oracle_points]) for cloud in points]
    pair = [
        timed(lambda one=one, two=two: (one.dist_sq(two.points), two.dist_sq(one.points)))[1]
        for one, two in zip(trees, trees[1:] + trees[:1], strict=True)
    ]
    return {"case_cpu_s": statistics.mean(case), "pair_cpu_s": statistics.mean(pair)}
