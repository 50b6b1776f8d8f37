"""Point clouds of the trained DDF: seconds per image against D_C and F, over n_v, N_H and departures from the paper.

Reads the models of `make reproduce-table` (artifacts/cpu); without them there is nothing to measure. Scores are means
over few images: they rank ways of drawing on the same images and are not those of the report.
"""

import dataclasses
import itertools
import statistics
import time
from pathlib import Path
from typing import Any

import _clouds
import _measure
import _test_views
import torch

from ddf.core import config
from ddf.fields import cloud_projection
from ddf.pipeline import stage
from ddf.reconstruction import inference, training_steps
from ddf.training import training_loop

CONFIG, CATEGORIES = Path("configs/cpu.yaml"), ("chair", "plane", "car")
IMAGES, THREADS = 2, 2
DIRECTIONS, CYCLES, PAPER = (4, 16), (1, 3), (128, 3)  # n_v, N_H, and both of the paper, a third of all the time
DEPARTURES = (
    ("jitter",),
    ("jitter", "resample"),
    ("recheck",),
    ("spread", "least_confidence", "crowding", "mirror", "oversampling", "centre"),
)  # measured alone with all cycles, then together
# the paper's way; whatever else is set stays
PLAIN = {"jitter": 0.0, "resample": 0.0, "recheck": (), "spread": None, "least_confidence": 0.0, "crowding": 0.0}
PLAIN |= {"mirror": None, "oversampling": 0.1, "centre": None}


def settings(own: cloud_projection.CloudConfig) -> list[cloud_projection.CloudConfig]:
    """The paper's way over n_v and N_H; at the config's own n_v each of its departures alone; all of them; in brief."""
    paper, most = dataclasses.replace(own, **PLAIN), max(CYCLES)
    sizes = [*itertools.product(DIRECTIONS, CYCLES), (PAPER[0], 1), PAPER]
    chosen = [dataclasses.replace(paper, num_directions=n, cycles=h) for n, h in sizes]
    for names in DEPARTURES:
        change = {name: getattr(own, name) for name in names}
        chosen.append(dataclasses.replace(paper, cycles=most, **change))
    chosen += [dataclasses.replace(own, num_directions=n, cycles=most) for n in DIRECTIONS]
    return list(dict.fromkeys([*chosen, dataclasses.replace(own, **_clouds.IN_BRIEF)]))


def told(cloud: cloud_projection.CloudConfig, points: int) -> dict[str, Any]:
    """The settings of a row."""
    departures = {name: getattr(cloud, name) for name in PLAIN}
    listed = {name: list(value) if isinstance(value, tuple) else value for name, value in departures.items()}
    return {"num_directions": cloud.num_directions, "cycles": cloud.cycles, **listed, "points": points}


def measure(category: str) -> list[dict]:
    """All settings on the first view of the first test shapes; one row per setting."""
    train = config.load(CONFIG, "train", training_steps.TrainConfig)
    section = config.load(CONFIG, "pointclouds", inference.PointcloudsConfig)
    model = training_steps.ddf_model(train, config.load(CONFIG, "ddf", training_steps.DDFConfig))
    training_loop.prepare(train.loop)
    torch.set_num_threads(THREADS)
    views = _test_views.read(CONFIG, category, IMAGES, {"train_ddf": model})
    _, latents, _ = inference.encode(model, views.images)
    with torch.no_grad():
        modulations = model.modulations(latents)
    rows = []
    for cloud in settings(section.cloud):
        seconds, scores = [], []
        for image in range(len(views.truths)):
            own = [m[image] for m in modulations]
            generator = torch.Generator().manual_seed(image)
            started = time.perf_counter()
            cycles = cloud_projection.sample(model.field, own, section.large, cloud, generator)
            (points,) = cloud_projection.select(cycles, [section.large], cloud)
            seconds.append(time.perf_counter() - started)
            scores.append(views.scores(image, points.numpy()))
        error = {name: statistics.fmean(score[name] for score in scores) for name in scores[0]}
        rows.append(_measure.row(category, told(cloud, section.large), seconds, error))
    return rows


def main() -> None:
    """Measure every category of the experiment; without its trained models say so and leave the results as they are."""
    lacking = [name for name in CATEGORIES if not _test_views.trained(CONFIG, name)]
    if lacking:
        folder = config.artifact_dir(CONFIG, "train_ddf", lacking[0])
        print(f"cloud_sampling: skipped, {folder} is not there; `make reproduce-table` makes it")
        return
    _measure.write("cloud_sampling", THREADS, [row for category in CATEGORIES for row in measure(category)])


if __name__ == "__main__":
    raise SystemExit(stage.guarded(main, "cloud_sampling"))
