"""Point clouds of the trained DDF: seconds per image against D_C and F, over n_v, N_H and departures from the paper.

Reads the models of `make reproduce-table` (artifacts/cpu); without them there is nothing to measure. Scores are means
over few images: they rank ways of drawing on the same images and are not those of the report.
"""

import dataclasses
import time
from pathlib import Path
from typing import Any

import _measure
import numpy as np
import torch

from ddf import (
    config,
    metrics,
    pointclouds,
    shapenet,
    si3dr_data,
    si3dr_inference,
    si3dr_training,
    stage,
    training,
    transforms,
)

CONFIG, CATEGORIES = Path("configs/cpu.yaml"), ("chair", "plane", "car")
TAU_SQ, IMAGES, THREADS = 1e-4, 2, 2
DIRECTIONS, CYCLES = (4, 16, 48, 128), (1, 3)
DEPARTURES = (("jitter",), ("recheck",), ("spread", "outliers"))  # measured alone, then together
PLAIN = {"jitter": 0.0, "recheck": (), "spread": None, "outliers": 0.0}  # the paper's way; whatever else is set stays
AFTER_A_CYCLE = {"jitter"}  # departures that make no difference to a single cycle
OWN_DIRECTIONS = (4, 16, 48)  # with all departures


def settings(own: pointclouds.CloudConfig) -> list[pointclouds.CloudConfig]:
    """The paper's way over n_v and N_H; then at the config's own n_v each of its departures alone, and all of them."""
    paper = dataclasses.replace(own, **PLAIN)
    chosen = [dataclasses.replace(paper, num_directions=n, cycles=h) for n in DIRECTIONS for h in CYCLES]
    for names in DEPARTURES:
        cycles = CYCLES[1:] if AFTER_A_CYCLE.issuperset(names) else CYCLES
        change = {name: getattr(own, name) for name in names}
        chosen += [dataclasses.replace(paper, cycles=h, **change) for h in cycles]
    chosen += [dataclasses.replace(own, num_directions=n, cycles=max(CYCLES)) for n in OWN_DIRECTIONS]
    return list(dict.fromkeys(chosen))


def told(cloud: pointclouds.CloudConfig, points: int) -> dict[str, Any]:
    """The settings of a row."""
    departures = {name: getattr(cloud, name) for name in PLAIN}
    listed = {name: list(value) if isinstance(value, tuple) else value for name, value in departures.items()}
    return {"num_directions": cloud.num_directions, "cycles": cloud.cycles, **listed, "points": points}


def measure(category: str) -> list[dict]:
    """All settings on the first view of the first test shapes; one row per setting."""
    train = config.load(CONFIG, "train", si3dr_training.TrainConfig)
    section = config.load(CONFIG, "pointclouds", si3dr_inference.PointcloudsConfig)
    model = si3dr_training.ddf_model(train, config.load(CONFIG, "ddf", si3dr_training.DDFConfig))
    training.prepare(train.loop)
    torch.set_num_threads(THREADS)
    training.load_model(model, config.artifact_dir(CONFIG, "train_ddf", category))
    dataset = shapenet.Dataset.open(config.artifact_dir(CONFIG, "dataset") / "index.json")
    samples = config.artifact_dir(CONFIG, "samples", category)
    shown = si3dr_data.available(samples, si3dr_data.test_views(dataset, category, 1))[:IMAGES]
    images = si3dr_data.read_images(dataset, category, shown, train.image_size)
    shapes = si3dr_data.read_shapes(samples, images.ids)
    factors = transforms.BENCHMARK_FROM_V1 / shapes.field_scales(images.shapes).numpy()
    _, latents, _ = si3dr_inference.encode(model, images)
    with torch.no_grad():
        modulations = model.modulations(latents)
    rows = []
    for cloud in settings(section.cloud):
        seconds, scores = [], []
        for image, shape in enumerate(images.shapes):
            own = [m[image] for m in modulations]
            truth = shapes.clouds[shape].numpy().astype(np.float64) * factors[image]
            generator = torch.Generator().manual_seed(image)
            started = time.perf_counter()
            cycles = pointclouds.sample(model.field, own, section.large, cloud, generator)
            (points,) = pointclouds.select(cycles, [section.large], cloud)
            seconds.append(time.perf_counter() - started)
            value = metrics.compare_clouds(points.numpy().astype(np.float64) * factors[image], truth, TAU_SQ)
            scores.append((1e3 * value.chamfer_l2_sq, 100 * value.f_score_tau))
        chamfer, f_score = np.mean(scores, axis=0)
        error = {"chamfer_l2_sq_x1000": float(chamfer), "f_score_tau_x100": float(f_score)}
        rows.append(_measure.row(category, told(cloud, section.large), seconds, error))
    return rows


def main() -> None:
    """Measure every category of the experiment; without its trained models say so and leave the results as they are."""
    lacking = [folder for name in CATEGORIES if not (folder := config.artifact_dir(CONFIG, "train_ddf", name)).exists()]
    if lacking:
        print(f"cloud_sampling: skipped, {lacking[0]} is not there; `make reproduce-table` makes it")
        return
    _measure.write("cloud_sampling", THREADS, [row for category in CATEGORIES for row in measure(category)])


if __name__ == "__main__":
    raise SystemExit(stage.guarded(main, "cloud_sampling"))
