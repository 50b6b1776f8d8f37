"""Loss and parameter gradient of one step: explicit derivative passes against one autograd call per derivative.

Widths and sample mix of the SI3DR training of [DDF22] (two shapes of its 32), all ways from the same numbers; the error
is that of the loss and of the parameter gradient against the plain way in float64.
"""

import argparse
import functools
import itertools
import json
import statistics
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import torch
from torch import Tensor
from torch.nn import functional

from bench.lib import measuring, page
from bench.rivals import plain_loss
from ddf.data.samples import sample_batch
from ddf.fields import losses, passes, pddf
from ddf.models import reconstruction_settings
from ddf_lab.run import Run

THREADS, REPEATS, MOST_SECONDS = 2, 5, 10.0
COUNTS = {"E": 1000, "U": 1200, "A": 1200, "B": 300, "S": 300, "T": 300, "O": 300}
CONFIGS = {"paper": Path("configs/paper.yaml"), "cpu.yaml": Path("configs/cpu.yaml")}  # whose widths are measured
WEIGHTS = losses.LossWeights()


def batch(shapes: int, dtype: torch.dtype) -> sample_batch.SampleBatch:
    """Random oriented points with random ground truth: the arithmetic is the same whatever they are."""
    generator, n = torch.Generator().manual_seed(0), sum(COUNTS.values())
    uniform = torch.rand((shapes, n, 5), generator=generator, dtype=torch.float64)
    unit = functional.normalize(torch.randn((2, shapes, n, 3), generator=generator, dtype=torch.float64), dim=-1)
    visible = (uniform[..., 3] > 0.4).to(dtype)
    return sample_batch.SampleBatch(
        (2 * uniform[..., :3] - 1).to(dtype),
        unit[0].to(dtype),
        visible,
        uniform[..., 4].to(dtype),
        unit[1].to(dtype),
        COUNTS,
    )


def plain(decoder: pddf.ConditionalPDDF, points: sample_batch.SampleBatch, latent: Tensor) -> Tensor:
    """𝔏_S by autograd alone."""
    return plain_loss.plain_loss(decoder.field, points, decoder.modulator(latent), WEIGHTS)


def explicit(
    decoder: pddf.ConditionalPDDF,
    points: sample_batch.SampleBatch,
    latent: Tensor,
    matmul: Literal["float32", "bfloat16"] = "float32",
) -> Tensor:
    """𝔏_S by the package."""
    return losses.shape_loss(decoder.field, points, decoder.modulator(latent), WEIGHTS, matmul)[0]


WAYS = {
    "plain": plain,
    "explicit": explicit,
    "explicit, bfloat16 products": functools.partial(explicit, matmul="bfloat16"),
}


def kind_of(way: str) -> torch.dtype:
    """Type that a way's products are made in."""
    return torch.bfloat16 if "bfloat16" in way else torch.float32


def step_of(loss: Callable[..., Tensor], hidden: tuple[int, ...], dtype: torch.dtype) -> Callable[[], tuple]:
    """One step, the same numbers whatever the type: loss and gradient of all parameters."""
    torch.manual_seed(0)
    decoder = pddf.ConditionalPDDF(pddf.PDDFConfig(hidden, 3.0, 1.0, "softplus", 100.0), 64).to(dtype)
    points, latent = batch(2, dtype), torch.randn(2, 64, dtype=torch.float32).to(dtype)
    parameters = list(decoder.parameters())

    def step() -> tuple[Tensor, tuple[Tensor, ...]]:
        value = loss(decoder, points, latent)
        return value.detach(), torch.autograd.grad(value, parameters)

    return step


def result(step: Callable[[], tuple]) -> tuple[float, Tensor]:
    """Loss and gradient as one float64 vector."""
    value, gradients = step()
    return float(value), torch.cat([gradient.flatten().double() for gradient in gradients])


def matmul_rate(width: int, rows: int, dtype: torch.dtype) -> float:
    """GFLOP/s of this machine's product at the field's own sizes."""
    left, right = torch.randn(rows, width).to(dtype), torch.randn(width, width).to(dtype)
    seconds = measuring.interleaved({"product": lambda: left @ right}, REPEATS)["product"]
    return 2 * rows * width**2 / sorted(seconds)[len(seconds) // 2] / 1e9


def gradient_products(hidden: tuple[int, ...]) -> float:
    """Multiply-adds per point that the step needs at least: every pass is a product per layer, and twice that back."""
    layers = 6 * hidden[0] + sum(a * b for a, b in itertools.pairwise(hidden)) + 4 * hidden[-1]
    total = sum(COUNTS.values())
    adjoint = sum(COUNTS[k] for k in "UAB") / total
    tangent = sum(COUNTS[k] for k in "EUABST") / total
    return 3 * layers * (1 + adjoint + tangent)


def widths(path: Path) -> tuple[int, ...]:
    """Of a config's hidden layers of the DDF."""
    return Run.read(path).section(reconstruction_settings.TrainConfig).decoder.hidden


def rows_of(name: str, hidden: tuple[int, ...], repeats: int) -> list[dict[str, Any]]:
    """One row per way; shares are of the rate in the type that the products are made in.

    Ways with products in bfloat16 are left out where the processor has none.
    """
    truth, exact = result(step_of(plain, hidden, torch.float64))
    rounded = passes.has_bfloat16(torch.device("cpu"))
    ways = {way: loss for way, loss in WAYS.items() if rounded or kind_of(way) != torch.bfloat16}
    steps = {way: step_of(loss, hidden, torch.float32) for way, loss in ways.items()}
    found = {way: result(step) for way, step in steps.items()}
    points, kinds = 2 * sum(COUNTS.values()), {kind_of(way) for way in ways}
    before = {kind: matmul_rate(max(hidden), points, kind) for kind in kinds}
    times = measuring.interleaved(steps, repeats, MOST_SECONDS)
    rates = {kind: max(before[kind], matmul_rate(max(hidden), points, kind)) for kind in kinds}
    rows = []
    for way, seconds in times.items():
        value, gradient = found[way]
        error = {
            "loss_relative": abs(value - truth) / abs(truth),
            "gradient_relative": float((gradient - exact).norm() / exact.norm()),
        }
        entry = measuring.row(f"{way}, {name}", {"hidden": hidden, "points": points}, seconds, error)
        used = 2 * gradient_products(hidden) * points / entry["median_s"] / 1e9
        rate = rates[kind_of(way)]
        ratios = [slow / fast for slow, fast in zip(times["plain"], seconds, strict=False)]  # of the same turns
        rows.append(
            {
                **entry,
                "points_per_s": points / entry["median_s"],
                "times_plain": statistics.median(ratios),
                "matmul_gflops": rate,
                "share_of_matmul_rate": used / rate,
            }
        )
    return rows


PICTURE = (page.View("gradient_relative", "relative error of the gradient", ("hidden",)),)


def main(given: Sequence[str]) -> None:
    """Measure every way at every width and write the table; --widths and --repeats for a look at a part, unwritten."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--widths", choices=list(CONFIGS), help="these alone; prints instead of writing")
    parser.add_argument("--repeats", type=int, default=REPEATS)
    chosen = parser.parse_args(given)
    torch.set_num_threads(THREADS)
    rows = []
    for name in [chosen.widths] if chosen.widths else list(CONFIGS):
        rows += rows_of(name, widths(CONFIGS[name]), chosen.repeats)
    if chosen.widths:
        print(json.dumps(rows, indent=1))
    else:
        measuring.write("training_step", THREADS, rows)
