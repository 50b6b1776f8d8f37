"""Does a file give what the model gives: onnxruntime against torch, both in float32.

Compared are random inputs at several lengths of the free axis, no rows, and, for fields, the hard cases: corners, edges
and faces of the box, directions with exact (and negative) zeros, rays that graze the surface, start on it (d = 0), have
a saturated visibility or stand where the two components are equally heavy. A tolerance holds where the output is
continuous (`field_outputs`); elsewhere it has to be finite, and such rows must be rare among the random ones.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import onnxruntime
import torch
from jaxtyping import Float
from torch import Tensor, nn

from ddf.core import checks
from ddf.fields import pddf
from ddf.geometry import rays
from ddf.io import onnx_graphs
from ddf.io.onnx_graphs import DYNAMIC, Graph

HARD, NO_ROWS = "hard", "no rows"
HARD_OF_EACH = 64  # rays of every hard kind that has to be searched for
SEARCHED = 4096  # random rays that they are searched among
MOST_UNCLEAR = 0.05  # share of random rows that a check may leave to `finite` alone


class ParityError(checks.InputError):
    """A file does not give what its model gives: it must not be used. One line: which output, by how much."""


@dataclass(frozen=True)
class Row:
    """One output on one set of inputs.

    bytes: of the file. max_abs, mean_abs: |onnxruntime - torch| over the clear rows; for outputs without a bound
    (curvatures) divided by max(1, |value|). tolerance: what max_abs is held to. unclear: rows left to the check for
    finite values.
    """

    graph: str
    bytes: int
    cases: str
    rows: int
    output: str
    max_abs: float
    mean_abs: float
    tolerance: float
    unclear: int


def session(data: bytes) -> onnxruntime.InferenceSession:
    """A CPU session with one thread."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])


def run(
    runner: onnxruntime.InferenceSession, inputs: Mapping[str, Tensor], names: Sequence[str]
) -> dict[str, np.ndarray]:
    """Named outputs of a session, as arrays."""
    found = runner.run(list(names), {key: value.numpy() for key, value in inputs.items()})
    return {name: np.asarray(value) for name, value in zip(names, found, strict=True)}


@torch.no_grad()
def compare(data: bytes, name: str, graph: Graph, batches: Sequence[int], seed: int = 0) -> list[Row]:
    """Every output on random inputs of every length and on the hard cases.

    Args:
      data: the file. name: of the graph, for the table. batches: lengths of the free axis.
    Raises:
      ParityError: onnxruntime cannot load or run the file, also on no rows, or a value has another shape, is not
        finite or outside its tolerance.
    """
    try:
        runner = session(data)
    except Exception as error:  # onnxruntime has a class of its own per fault, none of them public
        raise ParityError(f"{name}: onnxruntime cannot load the file: {_line(error)}") from error
    generator = torch.Generator().manual_seed(seed)
    lengths = sorted({min(length, graph.largest_batch or length) for length in batches})
    sets = {f"random {length}": example_inputs(graph, length, generator) for length in lengths}
    sets[HARD] = hard_inputs(graph, generator)
    sets[NO_ROWS] = example_inputs(graph, 0, generator) if graph.may_be_empty else {}
    rows: list[Row] = []
    for cases, inputs in sets.items():
        if not inputs:
            continue
        try:
            actual = run(runner, inputs, list(graph.meanings))
        except Exception as error:  # as above
            raise ParityError(f"{name}: onnxruntime cannot run {cases}: {_line(error)}") from error
        rows += _rows(graph, name, cases, inputs, actual, len(data))
    require(rows)
    return rows


def require(rows: Sequence[Row]) -> None:
    """Raise ParityError naming the worst output where one is outside its tolerance or too few rows were compared."""
    outside = [row for row in rows if not row.max_abs <= row.tolerance]  # NaN is outside
    if outside:
        worst = max(outside, key=lambda row: row.max_abs / row.tolerance)
        raise ParityError(
            f"{worst.graph}: onnxruntime and torch must agree on {worst.output} within {worst.tolerance:g}; "
            f"got {worst.max_abs:.3g} on {worst.cases} ({worst.rows} rows)"
        )
    for row in rows:
        if row.cases != HARD and row.unclear > max(1, MOST_UNCLEAR * row.rows):
            raise ParityError(
                f"{row.graph}: {row.output} must be continuous at {1 - MOST_UNCLEAR:.0%} of random rays at least; "
                f"{row.unclear} of {row.rows} are not"
            )


def example_inputs(graph: Graph, count: int, generator: torch.Generator) -> dict[str, Tensor]:
    """Random inputs with `count` rows on the free axis: points of the box, unit directions, latents, images."""
    makers: dict[str, Callable[[int, Sequence[int | str]], Tensor]] = {
        "positions": lambda rows, _: torch.rand((rows, 3), generator=generator) * 2 - 1,
        "directions": lambda rows, _: nn.functional.normalize(torch.randn((rows, 3), generator=generator), dim=-1),
        "images": lambda rows, shape: onnx_graphs.example_images(rows, int(shape[-1]), generator),
    }
    row = torch.randint(1 << 16, (1,), generator=generator)
    return {
        name: graph.examples[name][row % len(graph.examples[name])]
        if name in graph.examples
        else makers[name](count if shape[0] == DYNAMIC else int(shape[0]), shape)
        for name, shape in graph.inputs.items()
    }


def box_rays() -> tuple[Float[Tensor, "n 3"], Float[Tensor, "n 3"]]:
    """Every corner, edge middle, face middle and the centre of the box, with the 26 directions of that lattice.

    Most directions have components that are exactly 0; they are given once as 0.0 and once as -0.0.
    """
    lattice = torch.tensor(list(itertools.product((-1.0, 0.0, 1.0), repeat=3)))
    directions = nn.functional.normalize(lattice[lattice.square().sum(-1) > 0], dim=-1)
    directions = torch.cat((directions, torch.where(directions == 0, -0.0, directions)))
    return lattice.repeat_interleave(len(directions), dim=0), directions.repeat(len(lattice), 1)


def hard_inputs(graph: Graph, generator: torch.Generator) -> dict[str, Tensor]:
    """The rays of `box_rays` and those that a search finds in the field itself; empty for graphs without a field."""
    found = example_inputs(graph, SEARCHED, generator)
    values = graph.values(found)
    if values is None:
        return {}
    raw, cosine = values.raw, (values.normals * values.directions).sum(-1).abs()
    depth = values.field.depth(raw)
    starts = rays.surface_points(values.positions, values.directions, depth).clamp(-1, 1)
    grazing, switching = cosine.argsort()[:HARD_OF_EACH], raw[:, pddf.WEIGHT_ROW].abs().argsort()[:HARD_OF_EACH]
    order = raw[:, pddf.VISIBILITY_ROW].argsort()
    chosen = torch.cat((grazing, switching, order[:HARD_OF_EACH], order[-HARD_OF_EACH:]))
    visible = order[-HARD_OF_EACH:]
    positions, directions = box_rays()
    found["positions"] = torch.cat((positions, values.positions[chosen], starts[visible], starts[visible]))
    found["directions"] = torch.cat(
        (directions, values.directions[chosen], values.directions[visible], -values.directions[visible])
    )
    return found


def _rows(
    graph: Graph, name: str, cases: str, inputs: Mapping[str, Tensor], actual: Mapping[str, np.ndarray], size: int
) -> list[Row]:
    """What onnxruntime gave beside what torch gives; nothing of no rows, of which only shapes are compared."""
    count = max(len(inputs[key]) for key, shape in graph.inputs.items() if shape[0] == DYNAMIC)
    clear = graph.clear(inputs) if count else {}
    rows = []
    for (output, theirs), ours in zip(actual.items(), graph(*inputs.values()), strict=True):
        if theirs.shape != tuple(ours.shape) or not np.isfinite(theirs).all():
            shape = tuple(ours.shape)
            raise ParityError(f"{name}: {output} must be finite, of shape {shape}, on {cases}; got {theirs.shape}")
        keep = clear[output].numpy() if output in clear else np.ones(len(theirs), dtype=bool)
        got, want = theirs[keep].astype(np.float64), ours.double().numpy()[keep]
        difference = np.abs(got - want) / (np.maximum(1.0, np.abs(want)) if output in graph.relative else 1.0)
        largest, mean = (float(difference.max()), float(difference.mean())) if difference.size else (0.0, 0.0)
        unclear = int((~keep).sum())
        rows.append(Row(name, size, cases, count, output, largest, mean, graph.tolerances[output], unclear))
    return rows if count else []


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:200]
