"""Rays per second of a plain field by width, precision and runtime, with the error of each against float64.

Fields are as initialised, not trained, which changes no time. Torch is given its best path by hand (`LayerLoop`:
frequencies folded into the weights, sines in place), onnxruntime the exported file, both in chunks that stay in the
cache. Normals are asked for on fewer rays. Errors are over the first `CHECKED` rays, away from those where rounding
chooses the other component or the normal's side.
"""

import copy
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from bench.lib import measuring, page
from ddf.fields import derivatives, field_values, passes, pddf
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


class LayerLoop:
    """A plain field as the shortest torch program: products and in-place sines, nothing allocated twice.

    products: type of the matrix products and their weights. sines: type that the angles are kept in.
    """

    def __init__(self, field: pddf.PDDF, outputs: Sequence[str], products: torch.dtype, sines: torch.dtype) -> None:
        network = field.network
        self.field, self.outputs, self.products, self.sines = field, outputs, products, sines
        self.layers = [
            ((layer.weight.detach() * omega).to(products), (layer.bias.detach() * omega).to(products))
            for layer, omega in zip(network.layers, network.omegas, strict=True)
        ]
        self.head = (network.head.weight.detach().to(products), network.head.bias.detach().to(products))

    @torch.inference_mode()
    def __call__(self, positions: Tensor, directions: Tensor) -> list[Tensor]:
        """The outputs in order."""
        hidden, slopes = torch.cat((positions, directions), dim=-1), []
        for weight, bias in self.layers:
            angles = functional.linear(hidden.to(self.products), weight, bias).to(self.sines)
            if "normals" in self.outputs:
                slopes.append(torch.cos(angles))
            hidden = angles.sin_()
        raw = functional.linear(hidden.to(self.products), *self.head).float()
        found = [pddf.visibility(raw), self.field.depth(raw)]
        if "normals" in self.outputs:
            rows = pddf.heavier_rows(raw).to(self.products)
            gradient = rows @ self.head[0][: pddf.NUM_COMPONENTS]
            for (weight, _), slope in zip(reversed(self.layers[1:]), reversed(slopes[1:]), strict=True):
                gradient = gradient.mul_(slope) @ weight
            along = gradient.mul_(slopes[0]) @ self.layers[0][0][:, derivatives.POSITION]
            found.append(derivatives.normals(along.float(), directions))
        return found


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
    full, brain = torch.float32, torch.bfloat16
    found: dict[str, Program] = {
        "torch, float32": LayerLoop(field, outputs, full, full),
        "onnxruntime, float32": onnx_program(field, outputs),
        "field_values.evaluate, float32": torch.inference_mode()(
            lambda p, v: list(field_values.evaluate(field, p, v, outputs).values())
        ),
    }
    if passes.has_bfloat16(field.network.head.weight.device):  # in software they would take minutes
        found["torch, bfloat16 products"] = LayerLoop(field, outputs, brain, full)
        found["torch, bfloat16"] = LayerLoop(field, outputs, brain, brain)
    return found


def measure(field: pddf.PDDF, outputs: Sequence[str]) -> list[dict[str, Any]]:
    """Every program on one field, one row each."""
    width, count = field.config.hidden[0], RAYS if outputs == VALUES else NORMAL_RAYS
    rays, few, chunk = random_rays(count), random_rays(CHECKED), CHUNK_VALUES // width
    truths, chosen = exact(field, few), programs(field, outputs)
    candidates = {name: (lambda run=run: in_chunks(run, rays, chunk)) for name, run in chosen.items()}
    times = measuring.interleaved(candidates, REPEATS, MOST_SECONDS)
    size = {"width": width, "layers": LAYERS[width], "rays": count, "threads": THREADS, "outputs": list(outputs)}
    rows = []
    for name, seconds in times.items():
        error = errors(in_chunks(chosen[name], few, chunk), {key: truths[key] for key in outputs})
        row = measuring.row(name, size, seconds, error)
        rows.append({**row, "rays_per_s": count / row["median_s"]})
    return rows


def _values_only(row: page.Row) -> bool:
    return row.size["outputs"] == list(VALUES)


PICTURE = (page.View("depth_mean", "mean error of depth", ("width",), _values_only),)


def main() -> None:
    """Measure every width, write."""
    torch.set_num_threads(THREADS)
    rows = []
    for width, layers in LAYERS.items():
        torch.manual_seed(0)
        field = pddf.PDDF(pddf.PDDFConfig((width,) * layers, OMEGA_FIRST, 1.0, "softplus", 100.0)).eval()
        rows += [row for outputs in (VALUES, WITH_NORMALS) for row in measure(field, outputs)]
    measuring.write("field_inference", THREADS, rows)
