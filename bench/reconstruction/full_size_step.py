"""One optimisation step at the sizes of configs/paper.yaml, on random data: seconds by part, and peak memory.

Each model has a process of its own, whose largest resident size is the memory. The parts are timed inside the package's
own step, by wrapping what it calls: `data` draws the batch, `encoders` are both networks forwards, `field` the value
and derivative losses of the DDF or decoder and Chamfer distance of PC-SIREN, `mask` the rendered mask; `backward` is
all of them back.
"""

import argparse
import contextlib
import dataclasses
import json
import resource
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any
from unittest import mock

from bench.lib import display, measuring
from ddf.core import config
from ddf.fields import losses, pddf
from ddf.reconstruction import category_data, reconstruction_models, step_cost, training_steps
from ddf.training import training_loop

CONFIG, THREADS = Path("configs/paper.yaml"), 2
SECTIONS = {"ddf": training_steps.DDFConfig, "pcsiren": training_steps.PCSirenConfig}
REPEATS, MOST_SECONDS = 2, 20.0  # a model's steps are not repeated any more once they took that long
# What is wrapped: part of the split, owner, name.
PARTS = (
    ("data", training_steps.Batch, "draw"),
    ("data", category_data.SampleSet, "draw"),
    ("data", category_data.ShapeSet, "subset"),
    ("encoders", reconstruction_models.Encoder, "forward"),
    ("field", losses, "shape_loss"),
    ("field", pddf.PointDecoder, "forward"),
    ("field", training_steps, "chamfer_loss"),
    ("mask", reconstruction_models, "mask_loss"),
)


@contextlib.contextmanager
def split(seconds: dict[str, float]) -> Iterator[None]:
    """While this lasts, the calls named in `PARTS` add their seconds to `seconds`."""

    def timed(part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            started = step_cost.now()
            result = function(*arguments, **named)
            seconds[part] = seconds.get(part, 0.0) + step_cost.now() - started
            return result

        return call

    with contextlib.ExitStack() as stack:
        for part, owner, name in PARTS:
            function = timed(part, getattr(owner, name))
            is_class_method = isinstance(vars(owner).get(name), classmethod)
            stack.enter_context(mock.patch.object(owner, name, staticmethod(function) if is_class_method else function))
        yield


def one_step(trial: step_cost.Trial, number: int) -> dict[str, float]:
    """Seconds of the parts of one whole step."""
    seconds: dict[str, float] = {}
    times = [step_cost.now()]
    with split(seconds):
        loss, _ = trial.loss(number)
    times.append(step_cost.now())
    trial.optimiser.zero_grad()
    loss.backward()
    times.append(step_cost.now())
    trial.optimiser.step()
    times.append(step_cost.now())
    whole = {"backward": times[2] - times[1], "optimiser": times[3] - times[2], "step": times[3] - times[0]}
    return seconds | {"other": times[1] - times[0] - sum(seconds.values())} | whole | {"loss": float(loss.detach())}


def measure(model: str, images: int) -> dict[str, Any]:
    """Steps of one model with `images` images, after one of two images that warms up; and this process's memory."""
    train = config.load(CONFIG, "train", training_steps.TrainConfig)
    train = dataclasses.replace(train, loop=dataclasses.replace(train.loop, threads=THREADS))
    training_loop.prepare(train.loop)

    section = config.load(CONFIG, model, SECTIONS[model])
    one_step(step_cost.trial(dataclasses.replace(train, batch_size=2), section), 0)
    own = step_cost.trial(dataclasses.replace(train, batch_size=images), section)
    steps: list[dict[str, float]] = []
    while len(steps) < REPEATS and sum(step["step"] for step in steps) < MOST_SECONDS:
        steps.append(one_step(own, len(steps)))
    peak_gib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return {"steps": steps, "peak_gib": peak_gib, "parameters": pddf.count_parameters(own.model)}


SECTION = display.Section(views=())  # steps of two models, which are no alternatives


def main(given: Sequence[str]) -> None:
    """Measure both models, each in a process of its own, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--images", type=int, help="of a batch (default: that of configs/paper.yaml)")
    parser.add_argument("--one", choices=list(SECTIONS), help=argparse.SUPPRESS)  # prints instead of writing
    arguments = parser.parse_args(given)
    images = arguments.images or config.load(CONFIG, "train", training_steps.TrainConfig).batch_size
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
