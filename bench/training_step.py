"""Loss and parameter gradient of one step: explicit derivative passes against one autograd call per derivative.

Widths and sample mix of the SI3DR training of [DDF22] (two shapes of its 32), float32 and both ways from the same
numbers; the error is that of the loss and of the parameter gradient against the plain way in float64.
"""

import itertools

import _measure
import _plain_loss
import torch
from torch import Tensor
from torch.nn import functional

from ddf import fields, losses

THREADS, REPEATS = 2, 9
COUNTS = {"E": 1000, "U": 1200, "A": 1200, "B": 300, "S": 300, "T": 300, "O": 300}
WIDTHS = {"paper": (512, 512, 512, 256, 256, 256, 256), "cpu.yaml": (192, 192, 192, 128, 128, 128)}
WEIGHTS = losses.LossWeights(5.0, "chosen", None, 10.0, 10.0, 1.0, 0.1, 0.25, 0.1, 0.25, 1.0)


def batch(shapes: int, dtype: torch.dtype) -> losses.SampleBatch:
    """Random oriented points with random ground truth: the arithmetic is the same whatever they are."""
    generator, n = torch.Generator().manual_seed(0), sum(COUNTS.values())
    uniform = torch.rand((shapes, n, 5), generator=generator, dtype=torch.float64)
    unit = functional.normalize(torch.randn((2, shapes, n, 3), generator=generator, dtype=torch.float64), dim=-1)
    visible = (uniform[..., 3] > 0.4).to(dtype)
    return losses.SampleBatch(
        (2 * uniform[..., :3] - 1).to(dtype),
        unit[0].to(dtype),
        visible,
        uniform[..., 4].to(dtype),
        unit[1].to(dtype),
        COUNTS,
    )


def explicit_loss(
    field: fields.PDDF, points: losses.SampleBatch, modulations: list[Tensor], weights: losses.LossWeights
) -> Tensor:
    """𝔏_S by the package."""
    return losses.shape_loss(field, points, modulations, weights)[0]


def matmul_rate(width: int, rows: int) -> float:
    """GFLOP/s of this machine's float32 product at the field's own sizes."""
    left, right = torch.randn(rows, width), torch.randn(width, width)
    seconds = _measure.interleaved({"product": lambda: left @ right}, REPEATS)["product"]
    return 2 * rows * width**2 / sorted(seconds)[len(seconds) // 2] / 1e9


def gradient_products(hidden: tuple[int, ...]) -> float:
    """Multiply-adds per point that the step needs at least: every pass is a product per layer, and twice that back."""
    layers = 6 * hidden[0] + sum(a * b for a, b in itertools.pairwise(hidden)) + 4 * hidden[-1]
    total = sum(COUNTS.values())
    adjoint = sum(COUNTS[k] for k in "UAB") / total
    tangent = sum(COUNTS[k] for k in "EUABST") / total
    return 3 * layers * (1 + adjoint + tangent)


def main() -> None:
    """Measure both ways at both widths and write the table."""
    torch.set_num_threads(THREADS)
    rows = []
    for name, hidden in WIDTHS.items():
        found: dict[str, tuple[float, Tensor]] = {}
        candidates = {}
        for dtype, ways in (
            (torch.float64, {"plain float64": _plain_loss.plain_loss}),
            (torch.float32, {"plain": _plain_loss.plain_loss, "explicit": explicit_loss}),
        ):
            torch.manual_seed(0)
            decoder = fields.ConditionalPDDF(fields.PDDFConfig(hidden, 3.0, 1.0, "softplus", 100.0), 64).to(dtype)
            points, latent = batch(2, dtype), torch.randn(2, 64, dtype=dtype)
            parameters = list(decoder.parameters())
            for way, loss in ways.items():

                def step(loss=loss, decoder=decoder, points=points, latent=latent, parameters=parameters):
                    value = loss(decoder.field, points, decoder.modulator(latent), WEIGHTS)
                    return value.detach(), torch.autograd.grad(value, parameters)

                value, gradients = step()
                found[way] = (float(value), torch.cat([gradient.flatten().double() for gradient in gradients]))
                if dtype == torch.float32:
                    candidates[way] = step
        truth, exact = found["plain float64"]
        times = _measure.interleaved(candidates, REPEATS)
        points_per_step = 2 * sum(COUNTS.values())
        for way, seconds in times.items():
            value, gradient = found[way]
            error = {
                "loss_relative": abs(value - truth) / abs(truth),
                "gradient_relative": float((gradient - exact).norm() / exact.norm()),
            }
            entry = _measure.row(f"{way}, {name}", {"hidden": hidden, "points": points_per_step}, seconds, error)
            rate = matmul_rate(max(hidden), points_per_step)
            used = 2 * gradient_products(hidden) * points_per_step / entry["median_s"] / 1e9
            rows.append(
                {**entry, "points_per_s": points_per_step / entry["median_s"], "share_of_matmul_rate": used / rate}
            )
    _measure.write("training_step", THREADS, rows)


if __name__ == "__main__":
    main()
