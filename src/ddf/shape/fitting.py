"""Fitting one field to one mesh: six sample types in memory, held-out errors, a budget of steps or of minutes.

The mesh is taken as it is: inner sheets and nested parts are part of the shape. It is moved to the field frame, and
training and held-out samples are drawn from random streams of their own. Source: [DDF22] §4.1, app. A and C.

Budget: `steps` is the reproducible way. `minutes` is the convenient one: the time of a step is measured on a copy of
the field, the number of steps follows from what is left of the budget after sampling, and the schedule is laid over
these steps, so the learning rate still ends at zero. Their number is kept in `plan.json`, for a resumed run.
"""

import dataclasses
import functools
import hashlib
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from ddf.core import checks, provenance, storage
from ddf.data import packing, sampling
from ddf.fields import framed_field, losses, pddf, rendering
from ddf.geometry import mesh_io, transforms
from ddf.shape import shape_field
from ddf.training import step_timing, training_loop

METRICS, PLAN = "fit.json", "plan.json"
THIN_BOX = (
    0.05  # a mesh thinner than this (of its longest side) is fitted in the cube: its own box has no room for rays
)
_RESERVE = 0.03  # of the time left, for what timing some steps does not see: checkpoints, a busier machine
_LEAST_STEPS = 10
_FLAT = 0.1  # share of a depth head's first weights that `start_flat` keeps


def _check_budget(where: str, steps: int | None, minutes: float | None) -> None:
    """Raise unless a fit has at least one budget, and a possible one."""
    if steps is None and minutes is None:
        raise checks.InputError(f"{where}.steps or {where}.minutes must be given; both are null")
    if steps is not None and steps < 1:
        raise checks.InputError(f"{where}.steps must be >= 1 or null; got {steps}")
    if minutes is not None and not 0 < minutes < float("inf"):
        raise checks.InputError(f"{where}.minutes must be > 0 or null; got {minutes}")


@dataclass(frozen=True)
class PageConfig:
    """Section `fit.page`: pictures and diagnostics of the fitted field.

    picture_size: pixels a side. up: axis of the mesh that points up. rays: random rays that the diagnostics are over.
    """

    picture_size: int
    up: Literal["y", "z"]
    rays: int

    def __post_init__(self) -> None:
        if not 8 <= self.picture_size <= 1024:
            raise checks.InputError(f"fit.page.picture_size must be in 8..1024; got {self.picture_size}")
        if self.rays < 1:
            raise checks.InputError(f"fit.page.rays must be >= 1; got {self.rays}")


@dataclass(frozen=True)
class AblationConfig:
    """Section `fit.ablation`: one fit without each sample type and one with all (`sample_ablation`).

    samples: drawn for each fit, all types together. held_out: per type, for the errors.
    steps, minutes: the budget of each fit, as in `FitConfig`; minutes set the steps of the fit with all types, and the
      other fits take as many.
    """

    samples: int
    held_out: int
    steps: int | None
    minutes: float | None

    def __post_init__(self) -> None:
        if self.samples < len(losses.ORDER) - 1:
            raise checks.InputError(f"fit.ablation.samples must be >= {len(losses.ORDER) - 1}; got {self.samples}")
        if self.held_out < 1:
            raise checks.InputError(f"fit.ablation.held_out must be >= 1; got {self.held_out}")
        _check_budget("fit.ablation", self.steps, self.minutes)


_PAGE, _ABLATION = PageConfig(168, "y", 20_000), AblationConfig(500_000, 25_000, None, 0.75)


@dataclass(frozen=True)
class FitConfig:
    """Section `fit`: a field, and how it is fitted to one shape.

    mesh: the file that the stage `fit_shape` fits, null for a procedural chair; `ddf fit` names its own.
    steps, minutes: the budget; steps decides where both are given, minutes include sampling but not the held-out
      errors.
    samples, held_out: drawn per type, for training and for the errors.
    batch: oriented points per type in a step, E the extra uniform ones; with + those of a type that are supervised by
      depth and visibility alone, for less than half the cost (`losses.STORED_VALUES`, may be left out).
    epsilon_o: offset of O samples, field units.
    box: the shape's own box (a cube, where that is too thin) or the cube [-1, 1]^3.
    margin: room between the shape and the sides of the box, field units: the longest side of the shape is
      2 (1 - margin), in the frame of samples and field. With 0, the paper's way, rays from outside begin on faces that
      lie in a side of the box, where the field is of two minds. Lengths in the config and in results are those of a
      shape whose longest side is 2.
    start: what the depths begin as: `flat`, nearly their mean over the training samples (`start_flat`), or `random`,
      the paper's, about `pddf.INITIAL_DEPTH`.
    page, ablation: read by the stages `fit_shape` and `ablate_samples` alone; no part of the fit itself, and not needed
      for `ddf fit`.
    """

    mesh: str | None
    field: pddf.PDDFConfig
    steps: int | None
    minutes: float | None
    samples: sampling.Counts
    held_out: sampling.Counts
    batch: dict[str, int]
    weights: losses.LossWeights
    epsilon_o: float
    box: Literal["tight", "cube"]
    margin: float
    start: Literal["flat", "random"]
    loop: training_loop.LoopConfig
    page: PageConfig = _PAGE
    ablation: AblationConfig = _ABLATION

    def __post_init__(self) -> None:
        losses.check_counts("fit.batch", self.batch)
        _check_budget("fit", self.steps, self.minutes)
        self.draw(self.box, self.samples, 0)

    def draw(self, box: Literal["tight", "cube"], counts: sampling.Counts, seed: int) -> sampling.SamplesConfig:
        """What `sampling.extract` draws."""
        epsilon_o = self.epsilon_o * (1 - self.margin)
        return sampling.SamplesConfig(counts, epsilon_o, "fixed", box, self.margin, seed=seed)

    def recipe(self) -> dict[str, Any]:
        """What decides the fitted field: everything but `page` and `ablation`."""
        own = [item.name for item in dataclasses.fields(self) if item.name not in ("page", "ablation")]
        return {name: getattr(self, name) for name in own}


DEFAULT = FitConfig(
    mesh=None,
    field=pddf.PDDFConfig((128, 128, 128, 128, 128), 2.0, 1.0, "softplus", 100.0, 0.5),
    steps=None,
    minutes=2.0,
    samples=sampling.Counts(U=250_000, A=250_000, B=125_000, S=125_000, T=125_000, O=125_000),
    held_out=sampling.Counts(U=10_000, A=10_000, B=10_000, S=10_000, T=10_000, O=10_000),
    batch={"U": 120, "A": 140, "B": 60, "S": 60, "T": 60, "O": 200, "E": 50}
    | {"U+": 350, "A+": 500, "B+": 300, "S+": 550, "T+": 450},
    weights=losses.LossWeights(5.0, "mixture", 0.02, 1.0, 1.0, 0.1, 0.5, 0.01, 0.05, 0.0, 1.0),
    epsilon_o=0.05,
    box="tight",
    margin=0.02,
    start="flat",
    loop=training_loop.LoopConfig(5e-3, "cosine", 50, 1.0, 2, 0, 50, 30.0, muon=0.03),
)


@dataclass(frozen=True)
class ShapeSamples:
    """Decoded samples of one shape by type, float32, and its box, field frame; depth is 0 on a miss.

    A type may be absent: the field is then fitted without it. unit: half of the shape's longest side, field units.
    """

    arrays: Mapping[str, Mapping[str, Tensor]]
    lower: Float[np.ndarray, "3"]
    upper: Float[np.ndarray, "3"]
    unit: float = 1.0

    def without(self, kind: str) -> "ShapeSamples":
        """The same without one type."""
        return dataclasses.replace(self, arrays={name: part for name, part in self.arrays.items() if name != kind})

    def batch_counts(self, counts: Mapping[str, int]) -> dict[str, int]:
        """The counts per step with the share of absent types given to the others, in their proportions.

        So a step sees as many supervised points whichever type is left out ([DDF22] app. `dataablation` keeps the
        number of samples; what a minibatch holds it does not say).
        """
        supervised = {kind: count for kind, count in counts.items() if kind != "E"}
        kept = {kind: count for kind, count in supervised.items() if losses.sample_type(kind) in self.arrays}
        share = sum(supervised.values()) / sum(kept.values())
        return {"E": counts["E"], **{kind: round(count * share) for kind, count in kept.items()}}

    def batch(self, counts: Mapping[str, int], random: np.random.Generator) -> losses.SampleBatch:
        """Random samples of each type in `counts`, with repetition, and `counts["E"]` uniform points of the box."""
        extra = counts["E"]
        position = random.uniform(self.lower, self.upper, (extra, 3)).astype(np.float32)
        direction = random.standard_normal((extra, 3)).astype(np.float32)
        direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
        chosen = [
            {
                "positions": torch.from_numpy(position),
                "directions": torch.from_numpy(direction),
                "visible": torch.zeros(extra),
                "depth": torch.zeros(extra),
                "normals": torch.zeros(extra, 3),
            }
        ]
        for kind in [name for name in losses.STORED if name in counts]:
            stored = self.arrays[losses.sample_type(kind)]
            rows = torch.from_numpy(random.integers(0, len(stored["depth"]), counts[kind]))
            chosen.append({name: values[rows] for name, values in stored.items()})
        joined = {name: torch.cat([part[name] for part in chosen])[None] for name in chosen[0]}
        return losses.SampleBatch(**joined, counts=counts)


def draw_samples(
    mesh: mesh_io.Mesh, config: FitConfig, counts: sampling.Counts, stream: str
) -> tuple[ShapeSamples, dict[str, float]]:
    """Samples of a mesh, field frame, and the largest errors of their stored form (`sampling.packing_errors`).

    Args:
      mesh: in [-1, 1]^3; it is shrunk to leave `config.margin`.
      stream: name of the random stream; training and held-out samples have their own.
    """
    unit = 1 - config.margin
    mesh = mesh_io.Mesh(unit * mesh.vertices, mesh.faces)
    lower, upper = mesh.box()
    box = "cube" if (upper - lower).min() < THIN_BOX * (upper - lower).max() else config.box
    drawn = config.draw(box, counts, config.loop.seed)
    packed, probes = sampling.extract(mesh, drawn, stream)
    arrays = {}
    for kind, _ in counts.items():
        samples = packing.decode({name: torch.from_numpy(values) for name, values in packed.items()}, kind)
        visible = samples["visible"]
        arrays[kind] = {
            "positions": samples["positions"],
            "directions": samples["directions"],
            "visible": visible.float(),
            "depth": samples["depth"].masked_fill(~visible, 0.0),
            "normals": samples["normals"],
        }
    sides = sampling.box_of(mesh, drawn)
    samples = ShapeSamples(arrays, sides.lower.astype(np.float64), sides.upper.astype(np.float64), unit)
    return samples, sampling.packing_errors([probes])


@torch.no_grad()
def start_flat(field: pddf.PDDF, samples: ShapeSamples) -> None:
    """Make both depths about the mean depth of the visible samples everywhere (derived here).

    From random heads of another mean all samples pull the depths the same way, so that an optimiser with momentum can
    carry them below zero at all points, where no gradient brings them back: the field then never has a depth.
    """
    visible = torch.cat([part["depth"][part["visible"] > 0] for part in samples.arrays.values()])
    head = field.network.head
    head.weight[: pddf.NUM_COMPONENTS] *= _FLAT
    head.bias[: pddf.NUM_COMPONENTS] = _mean(visible)


def step_loss(
    field: pddf.PDDF, samples: ShapeSamples, config: FitConfig, step: int
) -> tuple[Float[Tensor, ""], dict[str, Tensor]]:
    """𝔏_S of the batch of one step, which depends on the seed and the step's number alone."""
    random = np.random.default_rng((config.loop.seed, step))
    batch = samples.batch(samples.batch_counts(config.batch), random).to(field.network.head.weight.device)
    return losses.shape_loss(field, batch, None, config.weights, config.loop.matmul)


def seconds_per_step(field: pddf.PDDF, samples: ShapeSamples, config: FitConfig, budget_seconds: float) -> float:
    """Mean time of an optimisation step, measured on copies; the field and all random streams stay as they are."""

    def loss(trial: pddf.PDDF) -> training_loop.StepLoss:
        return functools.partial(step_loss, trial, samples, config)

    return step_timing.seconds_per_step(step_timing.Trainee(field, _groups, loss, config.loop), budget_seconds)


def _groups(field: pddf.PDDF) -> list[dict[str, Any]]:
    """Without decay AdamW is Adam."""
    return [{"params": list(field.parameters()), "weight_decay": 0.0}]


def _plan(
    field: pddf.PDDF, samples: ShapeSamples, config: FitConfig, out_dir: Path, identity: str, started: float
) -> int:
    """Number of steps: as given, as an earlier run of the same fit decided, or what the rest of the minutes allows.

    Args:
      started: when the minutes began, on the clock of `time.monotonic`.
    """
    if config.steps is not None:
        return config.steps
    if config.minutes is None:
        raise ValueError("steps and minutes cannot both be null")
    path = out_dir / PLAN
    if path.exists():
        plan = storage.read_json(path)
        if plan.get("fingerprint") == identity:
            return int(plan["steps"])
    each = seconds_per_step(field, samples, config, 60 * config.minutes)
    left = 60 * config.minutes - (time.monotonic() - started)
    steps = max(_LEAST_STEPS, int((1 - _RESERVE) * left / each))
    storage.write_json(path, {"fingerprint": identity, "steps": steps, "seconds_per_step": each})
    return steps


def fit(
    raw: mesh_io.Mesh,
    config: FitConfig,
    out_dir: Path,
    source: Mapping[str, str] | None = None,
    without: str | None = None,
) -> dict[str, Any]:
    """Fit a field to a mesh in its own frame; write model.safetensors (`shape_field.load`), log.csv and fit.json.

    Resumes from `out_dir` if an earlier run with the same mesh, config and code was stopped there.

    Args:
      source: name to checksum of the file that the mesh came from, for the record.
      without: a sample type that the field is not trained on; the held-out errors are of all six.
    Returns:
      The content of fit.json: held_out (`held_out_errors`), seconds, parameters, steps, seconds_per_step, box.
    Raises:
      InputError: the mesh has no triangle with an area.
    """
    started = time.monotonic()
    training_loop.prepare(config.loop)
    own_from_mesh = transforms.field_from_mesh(raw.vertices[np.unique(raw.faces)])
    mesh = mesh_io.Mesh(np.clip(own_from_mesh.apply(raw.vertices), -1.0, 1.0), raw.faces)
    samples, packing_errors = draw_samples(mesh, config, config.samples, "train")
    samples = samples if without is None else samples.without(without)
    field = pddf.PDDF(config.field).to(training_loop.device())
    if config.start == "flat":
        start_flat(field, samples)
    content = hashlib.sha256(raw.vertices.tobytes() + raw.faces.tobytes()).hexdigest()
    identity = provenance.fingerprint([config.recipe(), content, without], (), "ddf.shape.fitting")
    steps = _plan(field, samples, config, out_dir, identity, started)
    fingerprint = provenance.fingerprint([identity, steps])
    record = {
        "fingerprint": fingerprint,
        "seed": config.loop.seed,
        "sources": dict(source or {}),
        "packing_errors": packing_errors,
        **shape_field.description(
            config.field, samples.lower, samples.upper, transforms.Similarity(samples.unit).compose(own_from_mesh)
        ),
    }
    loss = functools.partial(step_loss, field, samples, config)
    trained = time.monotonic()
    training_loop.fit(
        field, _groups(field), loss, steps, config.loop, out_dir, record, f"fit without {without}" if without else "fit"
    )
    finished = time.monotonic()
    held_out, _ = draw_samples(mesh, config, config.held_out, "held_out")
    result = {
        "held_out": held_out_errors(field.eval(), held_out),
        "seconds": finished - started,
        "sampling_seconds": trained - started,
        "parameters": pddf.count_parameters(field),
        "steps": steps,
        "seconds_per_step": (finished - trained) / steps,
        "box": {"lower": samples.lower.tolist(), "upper": samples.upper.tolist()},
    }
    storage.write_json(out_dir / METRICS, result)
    return result


@torch.no_grad()
def held_out_errors(field: pddf.PDDF, samples: ShapeSamples) -> dict[str, Any]:
    """Errors per sample type, in halves of the shape's longest side ([DDF22]'s unit), as its table `dataablation`.

    Returns:
      depth_l1: mean |d_{i*} - d| over visible samples; depth_l1_x10: times ten, as printed. visibility_bce: mean over
      all samples, natural logarithm. normal_angle_deg_median, _p95: between normals over the visible U, A and B samples
      (the types that L_n covers; the truth is known to under 1 degree), and `normal_angle_deg` of each type.
    """
    found: dict[str, Any] = {"depth_l1": {}, "depth_l1_x10": {}, "visibility_bce": {}, "normal_angle_deg": {}}
    angles = []
    place = field.network.head.weight.device
    for kind, truth in samples.arrays.items():
        points = (truth["positions"].split(framed_field.CHUNK_RAYS), truth["directions"].split(framed_field.CHUNK_RAYS))
        chunks = [(p.to(place), v.to(place)) for p, v in zip(*points, strict=True)]
        raw = torch.cat([field(p, v) for p, v in chunks])
        visible = truth["visible"] > 0
        error = (field.depth(raw).cpu() - truth["depth"])[visible].abs() / samples.unit
        found["depth_l1"][kind] = _mean(error)
        found["depth_l1_x10"][kind] = 10 * _mean(error)
        logits = raw[:, pddf.VISIBILITY_ROW].cpu()
        found["visibility_bce"][kind] = float(functional.binary_cross_entropy_with_logits(logits, truth["visible"]))
        if kind in losses.ORDER[1:4]:
            normals = torch.cat([rendering.query(field, p, v, None, ["normals"])["normals"] for p, v in chunks])
            angle = _angle_deg(normals.cpu()[visible], truth["normals"][visible])
            found["normal_angle_deg"][kind] = _quantiles(angle)
            angles.append(angle)
    overall = _quantiles(torch.cat(angles))
    found["normal_angle_deg_median"], found["normal_angle_deg_p95"] = overall["median"], overall["p95"]
    return found


def _angle_deg(first: Float[Tensor, "n 3"], second: Float[Tensor, "n 3"]) -> Float[Tensor, "n"]:
    crossed = torch.linalg.cross(first, second).norm(dim=-1)
    return torch.rad2deg(torch.atan2(crossed, (first * second).sum(-1)))


def _mean(values: Tensor) -> float:
    """Mean, 0 of nothing."""
    return float(values.double().mean()) if len(values) else 0.0


def _quantiles(values: Tensor) -> dict[str, float]:
    """Median and 95 %, 0 of nothing."""
    if not len(values):
        return {"median": 0.0, "p95": 0.0}
    middle, high = np.quantile(values.numpy(), [0.5, 0.95])
    return {"median": float(middle), "p95": float(high)}
