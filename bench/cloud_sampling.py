"""Point clouds of the trained DDF: seconds per image against D_C and F, over n_v, N_H and departures from the paper.

Reads the models of `make reproduce-table` (artifacts/cpu); without them there is nothing to measure.
"""

import dataclasses
import time
from pathlib import Path

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

CONFIG, TAU_SQ, IMAGES = Path("configs/cpu.yaml"), 1e-4, 4
PAPER = {"num_directions": 128, "thinning": 1.0, "jitter": 0.0, "recheck": ()}
OURS = {"num_directions": 48, "thinning": 1.0, "jitter": 0.2, "recheck": (0.05, 0.1, 0.2)}
SETTINGS = (
    PAPER,
    {**PAPER, "num_directions": 48},
    {**PAPER, "num_directions": 48, "jitter": 0.2},
    {**PAPER, "num_directions": 48, "recheck": (0.05, 0.1, 0.2)},
    OURS,
    {**OURS, "thinning": 1.5},
    {**OURS, "num_directions": 16},
    {**OURS, "num_directions": 128},
)


def measure(category: str) -> list[dict]:
    """All settings on the first view of the first test shapes; one row per setting and number of cycles."""
    train = config.load(CONFIG, "train", si3dr_training.TrainConfig)
    section = config.load(CONFIG, "pointclouds", si3dr_inference.PointcloudsConfig)
    model = si3dr_training.ddf_model(train, config.load(CONFIG, "ddf", si3dr_training.DDFConfig))
    training.prepare(train.loop)
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
    for setting in SETTINGS:
        cloud = dataclasses.replace(section.cloud, **setting)
        seconds: dict[int, list[float]] = {}
        scores: dict[int, list[tuple[float, float]]] = {}
        for image, shape in enumerate(images.shapes):
            own = [m[image] for m in modulations]
            truth = shapes.clouds[shape].numpy().astype(np.float64) * factors[image]
            for cycles in (1, section.cloud.cycles):
                chosen = dataclasses.replace(cloud, cycles=cycles)
                generator = torch.Generator().manual_seed(image)
                started = time.perf_counter()
                found = pointclouds.sample(model.field, own, section.large, chosen, generator)[-1]
                (points,) = found.clouds([section.large], chosen)
                seconds.setdefault(cycles, []).append(time.perf_counter() - started)
                value = metrics.compare_clouds(points.numpy().astype(np.float64) * factors[image], truth, TAU_SQ)
                scores.setdefault(cycles, []).append((1e3 * value.chamfer_l2_sq, 100 * value.f_score_tau))
        for cycles, values in seconds.items():
            chamfer, f_score = np.mean(scores[cycles], axis=0)
            size = {**setting, "recheck": list(setting["recheck"]), "cycles": cycles, "points": section.large}
            error = {"chamfer_l2_sq_x1000": float(chamfer), "f_score_tau_x100": float(f_score)}
            rows.append(_measure.row(category, size, values, error))
    return rows


def main() -> None:
    """Measure every category of the experiment."""
    rows = [row for category in ("chair", "plane", "car") for row in measure(category)]
    threads = config.load(CONFIG, "train", si3dr_training.TrainConfig).loop.threads
    _measure.write("cloud_sampling", threads, rows)


if __name__ == "__main__":
    raise SystemExit(stage.guarded(main, "cloud_sampling"))
