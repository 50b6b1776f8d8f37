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

import torch

from bench.lib import display, measuring, results
from bench.reconstruction import brief_clouds, first_views
from ddf.fields import cloud_projection
from ddf.models.reconstruction import inference, reconstruction_models, settings
from ddf.training import training_loop
from ddf_lab.run import Run

CONFIG, CATEGORIES = Path("configs/cpu.yaml"), ("chair", "plane", "car")
IMAGES, THREADS = 2, 2
DIRECTIONS, CYCLES, PAPER = (4, 16), (1, 3), (128, 3)  # n_v, N_H, and both of the paper, a third of all the time
DEPARTURES = (
    ("jitter",),
    ("recheck",),
    ("spread", "least_confidence", "crowding"),
    ("aimed",),
)  # measured alone with all cycles, then together
# the paper's way; whatever else is set stays
PLAIN = {"jitter": 0.0, "recheck": (), "spread": None, "least_confidence": 0.0, "crowding": 0.0, "aimed": 0.0}


def variants(own: cloud_projection.CloudConfig) -> list[cloud_projection.CloudConfig]:
    """The paper's way over n_v and N_H; at the config's own n_v each of its departures alone; all of them; in brief."""
    paper, most = dataclasses.replace(own, **PLAIN), max(CYCLES)
    sizes = [*itertools.product(DIRECTIONS, CYCLES), (PAPER[0], 1), PAPER]
    chosen = [dataclasses.replace(paper, num_directions=n, cycles=h) for n, h in sizes]
    for names in DEPARTURES:
        change = {name: getattr(own, name) for name in names}
        chosen.append(dataclasses.replace(paper, cycles=most, **change))
    chosen += [dataclasses.replace(own, num_directions=n, cycles=most) for n in DIRECTIONS]
    return list(dict.fromkeys([*chosen, dataclasses.replace(own, **brief_clouds.IN_BRIEF)]))


def told(cloud: cloud_projection.CloudConfig, points: int) -> dict[str, Any]:
    """The settings of a row."""
    departures = {name: getattr(cloud, name) for name in PLAIN}
    listed = {name: list(value) if isinstance(value, tuple) else value for name, value in departures.items()}
    return {"num_directions": cloud.num_directions, "cycles": cloud.cycles, **listed, "points": points}


def measure(run: Run, category: str) -> list[dict]:
    """All settings on the first view of the first test shapes; one row per setting."""
    train = run.section(settings.TrainConfig)
    section = run.section(settings.PointcloudsConfig)
    model = reconstruction_models.ddf_model(train, run.section(settings.DDFConfig).field)
    training_loop.prepare(train.loop)
    torch.set_num_threads(THREADS)
    views = first_views.read(run, category, IMAGES, {"train_ddf": model})
    _, latents, _ = inference.encode(model, views.images)
    with torch.no_grad():
        modulations = model.modulations(latents)
    rows = []
    for cloud in variants(section.cloud):
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
        rows.append(measuring.row(category, told(cloud, section.large), seconds, error))
    return rows


PAPER_CLOUD = (128, 3)  # n_v and N_H of [DDF22]
CLOUD_DEPARTURES = ("jitter", "recheck", "spread")  # from it


def cloud_sentence(benchmark: results.Benchmark) -> str | None:
    """n_v and N_H against F(τ), both averaged over the categories."""
    settings: dict[str, list[results.Row]] = {}
    for row in benchmark.rows:
        if row.seconds:
            settings.setdefault(str(sorted(row.size.items())), []).append(row)
    if not settings:
        return None
    rows = [members[0] for members in settings.values()]
    seconds = [statistics.mean(row.seconds[1] for row in members if row.seconds) for members in settings.values()]
    scores = [statistics.mean(row.error["f_score_tau_x100"] for row in members) for members in settings.values()]
    best = results.frontier([(s, -f) for s, f in zip(seconds, scores, strict=True)])
    told = [_cloud_words(rows[i], seconds[i], scores[i]) for i in (best[0], best[-1])]
    plain = [
        i
        for i, row in enumerate(rows)
        if (row.size["num_directions"], row.size["cycles"]) == PAPER_CLOUD
        and not any(row.size.get(name) for name in CLOUD_DEPARTURES)
    ]
    words = f"of {len(rows)} settings {len(best)} are on the frontier, from {told[0]} to {told[1]}"
    if plain:
        words += f"; the paper's way is {_cloud_words(rows[plain[0]], seconds[plain[0]], scores[plain[0]])}"
    return f"**Point clouds**, {display.text(rows[0].size['points'])} points, means over the categories: {words}."


def _cloud_words(row: results.Row, seconds: float, score: float) -> str:
    extras = [name for name in CLOUD_DEPARTURES if row.size.get(name)]
    cycles = f"{row.size['cycles']} cycle{'s' if row.size['cycles'] > 1 else ''}"
    how = " with ".join(
        [f"{row.size['num_directions']} directions and {cycles}", *filter(None, [" and ".join(extras)])]
    )
    return f"{how} ({display.number(seconds)} s, F(τ) × 100 = {score:.1f})"


SECTION = display.Section(
    views=(display.View("f_score_tau_x100", "points missed: 100 - 100 F(τ)", ("what",), best=100.0),),
    headline=cloud_sentence,
)


def main() -> None:
    """Measure every category of the experiment; without its trained models say so and leave the results as they are."""
    run = Run.read(CONFIG)
    lacking = [name for name in CATEGORIES if not first_views.trained(run, name)]
    if lacking:
        folder = run.folder("train_ddf", lacking[0])
        print(f"cloud_sampling: skipped, {folder} is not there; `make reproduce-table` makes it")
        return
    measuring.write("cloud_sampling", THREADS, [row for category in CATEGORIES for row in measure(run, category)])
