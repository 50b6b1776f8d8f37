"""Loss and parameter gradient of one step: explicit derivative passes against one autograd call per derivative.

Widths and sample mix of the SI3DR training of [DDF22] (two shapes of its 32), all ways from the same numbers; the error
is that of the loss and of the parameter gradient against the plain way in float64.
"""

import argparse
import json
import statistics
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from torch.nn import functional

from bench.lib import measuring, page
from ddf.data.samples import sample_batch, sample_types
from ddf.fields import losses, pddf
from ddf.models import reconstruction_settings
from ddf_lab.run import Run

THREADS, REPEATS, MOST_SECONDS = 2, 5, 10.0
COUNTS = {"E": 1000, "U": 1200, "A": 1200, "B": 300, "S": 300, "T": 300, "O": 300}
CONFIGS = {"paper": Path("configs/paper.yaml"), "cpu.yaml": Path("configs/cpu.yaml")}  # whose widths are measured
WEIGHTS = losses.LossWeights()


KINDS = (*sample_types.ORDER, *sample_types.VALUES_ONLY)
DOUBLED = ("U", "A", "U+", "A+", "P")  # samples whose depth error counts twice


def plain_loss(
    field: pddf.PDDF, batch: sample_batch.SampleBatch, modulations: list[Tensor] | None, weights: losses.LossWeights
) -> Tensor:
    """𝔏_S by create_graph, written from the paper's formulas, one type at a time; none of the package's terms.

    Args:
      weights: with the paper's depth term, `depth_of` = chosen and `depth_huber` = None.
    """
    v, n, seen, truth = batch.directions, batch.normals, batch.visible, batch.depth
    p = batch.positions.clone().requires_grad_()
    raw = field(p, v, modulations)
    d, w, xi = field.depths(raw), torch.sigmoid(raw[..., 2]), torch.sigmoid(raw[..., 3])

    def gradient(values: Tensor) -> Tensor:
        return torch.autograd.grad(values.sum(), p, create_graph=True)[0]

    heaviest = (w < 0.5).long()[..., None]
    chosen = d.gather(-1, heaviest)[..., 0]
    unit = functional.normalize(gradient(raw[..., :2].gather(-1, heaviest)), dim=-1)
    rates = torch.stack([(gradient(d[..., i]) * v).sum(-1) for i in range(2)])
    xi_rate, w_rate = (gradient(xi) * v).sum(-1), (gradient(w) * n).sum(-1)
    stops = torch.tensor([0, *(batch.counts.get(k, 0) for k in KINDS)]).cumsum(0).tolist()
    where = {k: slice(stops[i], stops[i + 1]) for i, k in enumerate(KINDS)}
    known = [kind for kind in KINDS if kind != "E"]

    def mean(values: Tensor, kinds: Iterable[str]) -> Tensor:
        return torch.cat([values[:, where[k]] for k in kinds], dim=1).mean()

    doubled = torch.ones(raw.shape[1], dtype=raw.dtype)
    for kind in DOUBLED:
        doubled[where[kind]] = 2
    factor = seen.clone()
    factor[:, where["E"]] = xi[:, where["E"]].detach()
    eikonal = weights.eikonal_depth * factor * (rates + 1).square().sum(0) + weights.eikonal_visibility * xi_rate**2
    bce = -(seen * torch.log(xi) + (1 - seen) * torch.log(1 - xi))
    normal = -seen * (unit * n).sum(-1).abs()
    speed = torch.relu(weights.transition_speed - w_rate.abs()) ** 2
    return (
        weights.depth * mean(doubled * seen * (chosen - truth) ** 2, known)
        + weights.visibility * mean(bce, known)
        + weights.visibility_variance * mean(xi * (1 - xi), known)
        + weights.normals * mean(normal, "UAB")
        + mean(eikonal, "EUAB")
        + weights.weight_variance * mean(w * (1 - w), "EUAB")
        + weights.transition * mean(speed, "ST")
    )


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
    return plain_loss(decoder.field, points, decoder.modulator(latent), WEIGHTS)


def explicit(decoder: pddf.ConditionalPDDF, points: sample_batch.SampleBatch, latent: Tensor) -> Tensor:
    """𝔏_S by the package."""
    return losses.shape_loss(decoder.field, points, decoder.modulator(latent), WEIGHTS)[0]


WAYS = {"plain": plain, "explicit": explicit}


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


def widths(path: Path) -> tuple[int, ...]:
    """Of a config's hidden layers of the DDF."""
    return Run.read(path).section(reconstruction_settings.TrainConfig).decoder.hidden


def rows_of(name: str, hidden: tuple[int, ...], repeats: int) -> list[dict[str, Any]]:
    """One row per way."""
    truth, exact = result(step_of(plain, hidden, torch.float64))
    steps = {way: step_of(loss, hidden, torch.float32) for way, loss in WAYS.items()}
    found = {way: result(step) for way, step in steps.items()}
    points = 2 * sum(COUNTS.values())
    times = measuring.interleaved(steps, repeats, MOST_SECONDS)
    rows = []
    for way, seconds in times.items():
        value, gradient = found[way]
        error = {
            "loss_relative": abs(value - truth) / abs(truth),
            "gradient_relative": float((gradient - exact).norm() / exact.norm()),
        }
        entry = measuring.row(f"{way}, {name}", {"hidden": hidden, "points": points}, seconds, error)
        ratios = [slow / fast for slow, fast in zip(times["plain"], seconds, strict=False)]  # of the same turns
        told = {"points_per_s": points / entry["median_s"], "times_plain": statistics.median(ratios)}
        rows.append({**entry, **told})
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
