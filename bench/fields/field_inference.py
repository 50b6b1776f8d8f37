"""Rays per second of a plain field by width, precision and runtime, with the error of each against float64.

Fields are as initialised, not trained, which changes no time. Rays are asked for in chunks that stay in the cache,
fewer of them with normals. Errors are over the first `CHECKED` rays, away from those where rounding chooses the other
component or the normal's side.
"""

import copy
from collections.abc import Callable, Sequence

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from bench.lib import measuring
from ddf.fields import field_values, pddf
from ddf.io import onnx_file, onnx_graphs, onnx_parity

RAYS, NORMAL_RAYS, CHECKED = 65_536, 16_384, 8_192  # timed; timed with normals; whose errors are taken
CHUNK_VALUES = 2**18  # of one layer, rays times width: 1 MiB, which stays in the cache
LAYERS = {128: 6, 256: 6, 512: 7}
REPEATS, MOST_SECONDS = 7, 1.0
OMEGA_FIRST = 2.0  # as `ddf fit` has it
VALUES, WITH_NORMALS = ("visibility", "depth"), ("visibility", "depth", "normals")
THREADS = 2
Answer = list[np.ndarray]  # one array per output, in order
Truths = dict[str, tuple[np.ndarray, np.ndarray]]  # of each output: values, and which of them are clear


Program = Callable[[Tensor, Tensor], Sequence[Tensor | np.ndarray]]  # a chunk of rays to its outputs


def in_chunks(program: Program, rays: tuple[Tensor, Tensor], chunk: int) -> Answer:
    """Every ray, `chunk` at a time."""
    parts = [program(*piece) for piece in zip(*(part.split(chunk) for part in rays), strict=True)]
    return [np.concatenate([np.asarray(value) for value in values]) for values in zip(*parts, strict=True)]


def random_rays(count: int) -> tuple[Tensor, Tensor]:
    """Uniform in the box and on the sphere."""
    generator = torch.Generator().manual_seed(0)
    positions = 2 * torch.rand((count, 3), generator=generator) - 1
    return positions, functional.normalize(torch.randn((count, 3), generator=generator), dim=-1)


def onnx_program(field: pddf.PDDF, outputs: Sequence[str]) -> Program:
    """A session on the exported file."""
    with torch.no_grad():
        session = onnx_parity.session(onnx_file.to_onnx(onnx_graphs.FieldGraph(field, outputs), {}), THREADS)

    def program(positions: Tensor, directions: Tensor) -> list[np.ndarray]:
        inputs = {"positions": positions, "directions": directions}
        return list(onnx_parity.run(session, inputs, outputs).values())

    return program


def exact(field: pddf.PDDF, rays: tuple[Tensor, Tensor]) -> Truths:
    """What the field gives in float64, normals included."""
    graph = onnx_graphs.FieldGraph(copy.deepcopy(field).double(), WITH_NORMALS)
    inputs = {"positions": rays[0].double(), "directions": rays[1].double()}
    with torch.no_grad():
        clear = graph.clear(inputs)
        named = zip(graph.meanings, graph(*inputs.values()), strict=True)
        return {name: (values.numpy(), clear[name].numpy()) for name, values in named}


def errors(answer: Answer, truths: Truths) -> dict[str, float]:
    """Of the clear values."""
    found = {}
    for (name, (truth, keep)), values in zip(truths.items(), answer, strict=True):
        got, want = values.astype(np.float64)[keep], truth[keep]
        if name == "normals":
            angle = np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(got - want, axis=-1) / 2, 0, 1)))
            found |= {"normal_angle_deg_median": float(np.median(angle))}
            found |= {"normal_angle_deg_p999": float(np.quantile(angle, 0.999))}
        else:
            found |= {f"{name}_mean": float(np.abs(got - want).mean()), f"{name}_max": float(np.abs(got - want).max())}
    return found


def programs(field: pddf.PDDF, outputs: Sequence[str]) -> dict[str, Program]:
    """By runtime and precision."""
    evaluate = torch.inference_mode()(lambda p, v: list(field_values.evaluate(field, p, v, outputs).values()))
    return {"onnxruntime, float32": onnx_program(field, outputs), "field_values.evaluate, float32": evaluate}


def measure(field: pddf.PDDF, outputs: Sequence[str]) -> measuring.Rows:
    """Every program on one field, one row each."""
    width, count = field.config.hidden[0], RAYS if outputs == VALUES else NORMAL_RAYS
    rays, few, chunk = random_rays(count), random_rays(CHECKED), CHUNK_VALUES // width
    truths, chosen = exact(field, few), programs(field, outputs)
    candidates = {name: (lambda run=run: in_chunks(run, rays, chunk)) for name, run in chosen.items()}
    times = measuring.interleaved(candidates, REPEATS, MOST_SECONDS)
    size = {"width": width, "layers": LAYERS[width], "rays": count, "threads": THREADS, "outputs": list(outputs)}
    for name, seconds in times.items():
        error = errors(in_chunks(chosen[name], few, chunk), {key: truths[key] for key in outputs})
        row = measuring.row(name, size, seconds, error)
        yield {**row, "rays_per_s": count / row["median_s"]}


def main() -> measuring.Rows:
    """Every width, without normals and with."""
    for width, layers in LAYERS.items():
        torch.manual_seed(0)
        field = pddf.PDDF(pddf.PDDFConfig((width,) * layers, OMEGA_FIRST, 1.0, "softplus", 100.0)).eval()
        for outputs in (VALUES, WITH_NORMALS):
            yield from measure(field, outputs)
