"""Whether a device computes what the CPU computes: loss and gradients of a step, and the hits of a cloud."""

import contextlib
import dataclasses
from collections.abc import Iterator
from typing import Any
from unittest import mock

import torch
from torch import Tensor

from bench.gpu.sizes import Sizes
from ddf.fields import cloud_projection, passes, pddf
from ddf.training import training_loop
from ddf_lab.engine import step_cost

Gradients = dict[str, Tensor]  # float64, on the CPU, by parameter


@contextlib.contextmanager
def placed(device: str) -> Iterator[None]:
    """While this lasts, the package works on this device."""
    try:
        with mock.patch.object(training_loop, "device", lambda: torch.device(device)):
            yield
    finally:
        torch.use_deterministic_algorithms(False)  # a training on the CPU asks for them; cuBLAS then refuses to work


def gradients(sizes: Sizes, model: str, device: str, precision: passes.Matmul) -> tuple[float, Gradients]:
    """Loss and gradients of the first step with few images, from the same weights and data on every device."""
    loop = dataclasses.replace(sizes.train.loop, matmul=precision)
    train = dataclasses.replace(sizes.train, batch_size=sizes.compared_images, loop=loop)
    with placed(device):
        training_loop.prepare(loop)
        trial = step_cost.trial(train, sizes.sections[model])
        loss, _ = trial.loss(0)
        loss.backward()
        found = {name: p.grad for name, p in trial.model.named_parameters() if p.grad is not None}
        return float(loss.detach()), {name: grad.detach().cpu().double() for name, grad in found.items()}


def differences(own: tuple[float, Gradients], truth: tuple[float, Gradients]) -> dict[str, float]:
    """Relative difference of the losses and of all gradients together, their cosine, the worst parameter's difference.

    Raises:
      ValueError: the gradients are not of the same parameters.
    """
    (loss, mine), (exact, theirs) = own, truth
    if mine.keys() != theirs.keys():
        raise ValueError(f"gradients of other parameters: {sorted(mine.keys() ^ theirs.keys())}")
    both = [torch.cat([each[name].flatten() for name in theirs]) for each in (mine, theirs)]
    apart = {name: float((mine[name] - theirs[name]).norm()) for name in theirs}
    largest = {name: max(float(theirs[name].norm()), 1e-6 * float(both[1].norm())) for name in theirs}
    return {
        "loss_relative": abs(loss - exact) / abs(exact),
        "gradient_relative": float((both[0] - both[1]).norm() / both[1].norm()),
        "gradient_cosine": float(torch.nn.functional.cosine_similarity(*both, dim=0)),
        "worst_parameter_relative": max(apart[name] / largest[name] for name in theirs),
    }


@contextlib.contextmanager
def drawn_on_the_cpu() -> Iterator[None]:
    """While this lasts, torch draws with a generator of the CPU for every device: the same numbers on all."""

    def moved(draw: Any) -> Any:
        return lambda *size, generator, dtype, device: draw(*size, generator=generator, dtype=dtype).to(device)

    with contextlib.ExitStack() as stack:
        for name in ("rand", "randn"):
            stack.enter_context(mock.patch.object(torch, name, moved(getattr(torch, name))))
        yield


def hits(sizes: Sizes, device: str) -> Tensor:
    """Of the first cycle of a cloud of a plain field with random weights; float64, on the CPU."""
    torch.manual_seed(0)
    field = pddf.PDDF(sizes.ddf.field.of(sizes.train.decoder)).requires_grad_(False).to(device)
    with drawn_on_the_cpu():
        generator = torch.Generator().manual_seed(0)
        cycle, *_ = cloud_projection.sample(field, None, sizes.cloud_points, sizes.cloud, generator)
    return cycle.points.cpu().double()


def rows(sizes: Sizes, device: str) -> list[dict[str, Any]]:
    """Errors of the device against the CPU in float32, without times; the CPU's own bfloat16 beside the device's."""
    found = []
    for model in sizes.sections:
        truth = gradients(sizes, model, "cpu", "float32")
        tried: list[tuple[str, passes.Matmul]]
        tried = [(device, "float32"), (device, "tf32"), (device, "bfloat16"), ("cpu", "bfloat16")]
        for place, precision in dict.fromkeys(tried):
            error = differences(gradients(sizes, model, place, precision), truth)
            size = {"images": sizes.compared_images, "device": place}
            found.append({"what": f"{model} gradients, {precision}", "size": size, "error": error})
    training_loop.prepare(sizes.train.loop)
    off = (hits(sizes, device) - hits(sizes, "cpu")).norm(dim=-1)
    error = {"hit_median": float(off.median()), "hit_q99": float(off.quantile(0.99))}
    found.append({"what": "hits of a cloud", "size": {"points": len(off), "device": device}, "error": error})
    return found
