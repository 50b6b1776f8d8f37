"""One optimisation step at the sizes of configs/paper.yaml, on random data: seconds by part, and peak memory.

Each model has a process of its own, whose largest resident size is the memory. The parts are those of
`step_split`.
"""

import argparse
import dataclasses
import json
import resource
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.lib import display, measuring
from bench.reconstruction import step_split
from ddf.core import config
from ddf.fields import pddf
from ddf.models.reconstruction import settings
from ddf.training import training_loop
from ddf_lab.engine import step_cost

CONFIG, THREADS = Path("configs/paper.yaml"), 2
SECTIONS = {"ddf": settings.DDFConfig, "pcsiren": settings.PCSirenConfig}
REPEATS, MOST_SECONDS = 2, 20.0  # a model's steps are not repeated any more once they took that long


def measure(model: str, images: int) -> dict[str, Any]:
    """Steps of one model with `images` images, after one of two images that warms up; and this process's memory."""
    train = config.load(CONFIG, "train", settings.TrainConfig)
    train = dataclasses.replace(train, loop=dataclasses.replace(train.loop, threads=THREADS))
    training_loop.prepare(train.loop)

    section = config.load(CONFIG, model, SECTIONS[model])
    step_split.one_step(step_cost.trial(dataclasses.replace(train, batch_size=2), section), 0)
    own = step_cost.trial(dataclasses.replace(train, batch_size=images), section)
    steps: list[dict[str, float]] = []
    while len(steps) < REPEATS and sum(step["step"] for step in steps) < MOST_SECONDS:
        steps.append(step_split.one_step(own, len(steps)))
    peak_gib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return {"steps": steps, "peak_gib": peak_gib, "parameters": pddf.count_parameters(own.model)}


SECTION = display.Section(views=())  # steps of two models, which are no alternatives


def main(given: Sequence[str]) -> None:
    """Measure both models, each in a process of its own, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--images", type=int, help="of a batch (default: that of configs/paper.yaml)")
    parser.add_argument("--one", choices=list(SECTIONS), help=argparse.SUPPRESS)  # prints instead of writing
    arguments = parser.parse_args(given)
    images = arguments.images or config.load(CONFIG, "train", settings.TrainConfig).batch_size
    if arguments.one:
        print(json.dumps(measure(arguments.one, images)))
        return
    rows = []
    for model in SECTIONS:
        command = [sys.executable, "-m", "bench", "full_size_step", "--one", model, "--images", str(images)]
        found = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)
        steps = found["steps"]
        size = {"images": images, "parameters": found["parameters"], "repeats": len(steps), "device": "cpu"}
        seconds = [step["step"] for step in steps]
        row = measuring.row(model, size, seconds, {"loss": steps[-1]["loss"]})
        names = [name for name in steps[0] if name not in ("step", "loss")]
        parts = {name: sum(step[name] for step in steps) / len(steps) for name in names}
        rows.append({**row, "parts_s": parts, "peak_gib": found["peak_gib"]})
    measuring.write("full_size_step", THREADS, rows)
