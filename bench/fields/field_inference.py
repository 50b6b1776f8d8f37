"""Rays per second of a plain field by width, precision and runtime, with the error of each against float64. Fields are
as initialised, not trained, which changes no time; what reduced precisions cost a trained field is under onnx parity.

Torch is given its best path by hand (`LayerLoop`: frequencies folded into the weights, sines in place,
chunks that stay in the cache), onnxruntime the exported file in such chunks. Both are also run as two workers of one
thread each, on chunks of their own. Normals are asked for in float32 and in chunks alone, on fewer rays. Errors are
over the first `CHECKED` rays, away from those where rounding chooses the other component or the normal's side
(`onnx_outputs`).
"""

import copy
import shutil
import sysconfig
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent import futures
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from bench.lib import display, measuring, results
from ddf.fields import derivatives, field_values, passes, pddf
from ddf.io import onnx_file, onnx_graphs, onnx_parity, weight_precision

RAYS, NORMAL_RAYS, CHECKED = 65_536, 16_384, 8_192  # timed; timed with normals; whose errors are taken
CHUNK_VALUES = 2**18  # of one layer, rays times width: 1 MiB, which stays in the cache
LAYERS = {128: 6, 256: 6, 512: 7}
REPEATS, MOST_SECONDS = 7, 1.0
OMEGA_FIRST = 2.0  # as `ddf fit` has it
VALUES, WITH_NORMALS = ("visibility", "depth"), ("visibility", "depth", "normals")
COMPILERS = ("g++", "clang++", "c++")
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


def in_chunks(program: Program, rays: tuple[Tensor, Tensor], chunk: int, workers: int | None = None) -> Answer:
    """Every ray, `chunk` at a time, in turn or by so many workers."""
    pieces = list(zip(*(part.split(chunk) for part in rays), strict=True))
    if workers is None:
        parts: Iterable[Sequence[Any]] = (program(*piece) for piece in pieces)
    else:
        with futures.ThreadPoolExecutor(workers) as pool:
            parts = list(pool.map(lambda piece: program(*piece), pieces))
    return [np.concatenate([np.asarray(value) for value in values]) for values in zip(*parts, strict=True)]


def random_rays(count: int) -> tuple[Tensor, Tensor]:
    """Uniform in the box and on the sphere."""
    generator = torch.Generator().manual_seed(0)
    positions = 2 * torch.rand((count, 3), generator=generator) - 1
    return positions, functional.normalize(torch.randn((count, 3), generator=generator), dim=-1)


def onnx_program(data: bytes, outputs: Sequence[str], threads: int) -> Program:
    """A session on the file."""
    session = onnx_parity.session(data, threads)

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


class Exported:
    """A field, and its ONNX files: each is made once."""

    def __init__(self, field: pddf.PDDF) -> None:
        self.field = field
        self._files: dict[tuple[tuple[str, ...], str | None], bytes] = {}

    def data(self, outputs: Sequence[str], precision: str | None = None) -> bytes:
        """The file with these outputs, as it is or in a reduced precision."""
        key = (tuple(outputs), precision)
        if key not in self._files:
            if precision is None:
                with torch.no_grad():
                    self._files[key] = onnx_file.to_onnx(onnx_graphs.FieldGraph(self.field, outputs), {})
            else:
                self._files[key] = weight_precision.reduce(self.data(outputs), precision)
        return self._files[key]


def programs(exported: Exported, outputs: Sequence[str], threads: int) -> dict[tuple[str, str], Program]:
    """(runtime, precision) to program; all but float32 and what needs a compiler at `threads` > 1 only."""
    full, brain = torch.float32, torch.bfloat16
    field = exported.field
    found: dict[tuple[str, str], Program] = {
        ("torch", "float32"): LayerLoop(field, outputs, full, full),
        ("onnxruntime", "float32"): onnx_program(exported.data(outputs), outputs, threads),
    }
    if threads == 1:
        return found
    found["field_values.evaluate", "float32"] = torch.inference_mode()(
        lambda p, v: list(field_values.evaluate(field, p, v, outputs).values())
    )
    if passes.has_bfloat16(field.network.head.weight.device):  # in software they would take minutes
        found["torch", "bfloat16 products"] = LayerLoop(field, outputs, brain, full)
        found["torch", "bfloat16"] = LayerLoop(field, outputs, brain, brain)
    for precision in weight_precision.PRECISIONS:
        found["onnxruntime", precision] = onnx_program(exported.data(outputs, precision), outputs, threads)
    return found


def candidates(
    exported: Exported, outputs: Sequence[str], rays: tuple[Tensor, Tensor]
) -> dict[tuple[str, str, str], Callable[[], Answer]]:
    """(runtime, precision, how it is called) to the whole batch; with normals in float32 only."""
    found: dict[tuple[str, str, str], Callable[[], Answer]] = {}

    def add(key: tuple[str, str], program: Program, length: int, workers: int | None = None) -> None:
        how = "one call" if length == RAYS else f"chunks of {length:,}"
        each = 1 if workers else THREADS
        key_how = (*key, f"{how}, {workers} workers" if workers else how)
        found[key_how] = lambda: threaded(program, rays, length, each, workers)

    field = exported.field
    width = field.config.hidden[0]
    chunk = CHUNK_VALUES // width
    alone = programs(exported, outputs, 1)  # the runtimes themselves, a thread for each worker
    for key, program in programs(exported, outputs, THREADS).items():
        if outputs == VALUES or key[1] == "float32":
            add(key, program, chunk)
        if outputs == VALUES and key in alone and width < max(LAYERS):
            add(key, program, RAYS)
    for key, program in alone.items():
        add(key, program, chunk, THREADS)
    if outputs == VALUES and has_compiler():
        compiled = torch.compile(LayerLoop(field, outputs, torch.float32, torch.float32).__call__, dynamic=False)
        torch.set_num_threads(THREADS)
        compiled(rays[0][:chunk], rays[1][:chunk])  # compiles, which is no part of any sample
        add(("torch.compile", "float32"), compiled, chunk)
    return found


def has_compiler() -> bool:
    """Whether torch.compile can work here."""
    headers = Path(sysconfig.get_path("include")) / "Python.h"
    return headers.exists() and any(shutil.which(name) for name in COMPILERS)


def measure(
    exported: Exported, outputs: Sequence[str], error: Mapping[tuple[str, str], dict[str, float]]
) -> list[dict[str, Any]]:
    """Every program on one field, one row each.

    Args:
      error: of every runtime and precision (`checked_errors`).
    """
    width, count = exported.field.config.hidden[0], RAYS if outputs == VALUES else NORMAL_RAYS
    chosen = candidates(exported, outputs, random_rays(count))
    named = {", ".join(key): run for key, run in chosen.items()}
    times = measuring.interleaved(named, REPEATS, MOST_SECONDS)
    rows = []
    for (runtime, precision, how), (name, seconds) in zip(chosen, times.items(), strict=True):
        size = {"width": width, "layers": LAYERS[width], "rays": count, "threads": THREADS, "outputs": list(outputs)}
        same = (runtime.removesuffix(".compile"), precision)  # compiled: the same operations in the same precision
        row = measuring.row(name, size, seconds, error[same])
        told = {"runtime": runtime, "precision": precision, "how": how, "rays_per_s": count / row["median_s"]}
        rows.append({**row, **told})
    return rows


def checked_errors(exported: Exported) -> dict[tuple[str, str], dict[str, float]]:
    """Of every program with normals, on the first rays."""
    field, rays = exported.field, random_rays(RAYS)
    few, chunk = (rays[0][:CHECKED], rays[1][:CHECKED]), CHUNK_VALUES // field.config.hidden[0]
    truths = exact(field, few)
    return {
        key: errors(threaded(program, few, chunk, THREADS), truths)
        for key, program in programs(exported, WITH_NORMALS, THREADS).items()
    }


def threaded(
    program: Program, rays: tuple[Tensor, Tensor], chunk: int, threads: int, workers: int | None = None
) -> Answer:
    """`in_chunks` with so many torch threads in each worker."""
    torch.set_num_threads(threads)
    return in_chunks(program, rays, chunk, workers)


def _values_only(row: results.Row) -> bool:
    return row.size["outputs"] == list(VALUES)


def sentence(benchmark: results.Benchmark) -> str | None:
    """The fastest of onnxruntime and of torch at each width, in float32."""
    parts = []
    for outputs, width in dict.fromkeys((tuple(row.size["outputs"]), row.size["width"]) for row in benchmark.rows):
        full = [
            row
            for row in benchmark.rows
            if (tuple(row.size["outputs"]), row.size["width"], row.told["precision"]) == (outputs, width, "float32")
        ]
        sides = [[row for row in full if (row.told["runtime"] == "onnxruntime") is onnx] for onnx in (True, False)]
        parts.append(f"{outputs[-1]}, width {width}: {display.times(*map(display.fastest, sides))}")
    return f"Fastest way of onnxruntime, as a multiple of the fastest of torch, float32: {'; '.join(parts)}."


SECTION = display.Section((display.View("depth_mean", "mean error of depth", ("width",), _values_only),), sentence)


def main() -> None:
    """Measure every width, write."""
    rows = []
    for width, layers in LAYERS.items():
        torch.manual_seed(0)
        exported = Exported(pddf.PDDF(pddf.PDDFConfig((width,) * layers, OMEGA_FIRST, 1.0, "softplus", 100.0)).eval())
        error = checked_errors(exported)
        rows += [row for outputs in (VALUES, WITH_NORMALS) for row in measure(exported, outputs, error)]
    if not has_compiler():
        print("torch.compile left out: there is no C++ compiler with the headers of Python")
    measuring.write("field_inference", THREADS, rows)
