"""Fitting one field to one mesh: six sample types in memory, held-out errors, a budget of steps or of minutes.

The mesh is taken as it is: inner sheets and nested parts are part of the shape. It is moved to the field frame, and
training and held-out samples are drawn from random streams of their own. Source: [DDF22] §4.1, app. A and C.

Budget: `steps` is the reproducible way. `minutes` is the convenient one: the time of a step is measured on a copy of
the field, the number of steps follows from what is left of the budget after sampling, and the schedule is laid over
these steps, so the learning rate still ends at zero. Their number is kept in `plan.json`, for a resumed run.
"""

import functools
import hashlib
import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from ddf.core import provenance, storage
from ddf.data.samples import sample_types
from ddf.fields import framed_field, losses, pddf, rendering
from ddf.geometry import mesh_io, transforms
from ddf.shape import fit_settings, shape_field, shape_samples
from ddf.training import step_timing, training_loop

METRICS, PLAN = "fit.json", "plan.json"
_RESERVE = 0.03  # of the time left, for what timing some steps does not see: checkpoints, a busier machine
_LEAST_STEPS = 10
_FLAT = 0.1  # share of a depth head's first weights that `start_flat` keeps


@torch.no_grad()
def start_flat(field: pddf.PDDF, samples: shape_samples.ShapeSamples) -> None:
    """Make both depths about the mean depth of the visible samples everywhere (derived here).

    From random heads of another mean all samples pull the depths the same way, so that an optimiser with momentum can
    carry them below zero at all points, where no gradient brings them back: the field then never has a depth.
    """
    visible = torch.cat([part["depth"][part["visible"] > 0] for part in samples.arrays.values()])
    head = field.network.head
    head.weight[: pddf.NUM_COMPONENTS] *= _FLAT
    head.bias[: pddf.NUM_COMPONENTS] = _mean(visible) if len(visible) else 0.0


def step_loss(
    field: pddf.PDDF, samples: shape_samples.ShapeSamples, config: fit_settings.FitConfig, step: int
) -> tuple[Float[Tensor, ""], dict[str, Tensor]]:
    """𝔏_S of the batch of one step, which depends on the seed and the step's number alone."""
    random = np.random.default_rng((config.loop.seed, step))
    batch = samples.batch(samples.batch_counts(config.batch), random).to(field.network.head.weight.device)
    return losses.shape_loss(field, batch, None, config.weights, config.loop.matmul)


def seconds_per_step(
    field: pddf.PDDF, samples: shape_samples.ShapeSamples, config: fit_settings.FitConfig, budget_seconds: float
) -> float:
    """Mean time of an optimisation step, measured on copies; the field and all random streams stay as they are."""

    def loss(trial: pddf.PDDF) -> training_loop.StepLoss:
        return functools.partial(step_loss, trial, samples, config)

    return step_timing.seconds_per_step(step_timing.Trainee(field, _groups, loss, config.loop), budget_seconds)


def _groups(field: pddf.PDDF) -> list[dict[str, Any]]:
    """Without decay AdamW is Adam."""
    return [{"params": list(field.parameters()), "weight_decay": 0.0}]


def _plan(
    field: pddf.PDDF,
    samples: shape_samples.ShapeSamples,
    config: fit_settings.FitConfig,
    out_dir: Path,
    identity: str,
    started: float,
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
    config: fit_settings.FitConfig,
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
    own_from_mesh = transforms.field_from_mesh(raw.surface_vertices())
    inside = np.clip(own_from_mesh.apply(raw.vertices), -1.0, 1.0)
    mesh = mesh_io.Mesh(inside, mesh_io.without_flat(raw).faces)  # clipped, a far flat triangle could gain an area
    samples, packing_errors = shape_samples.draw_samples(mesh, config, config.samples, "train", config.tangents)
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
    held_out, _ = shape_samples.draw_samples(mesh, config, config.held_out, "held_out")
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
def held_out_errors(field: pddf.PDDF, samples: shape_samples.ShapeSamples) -> dict[str, Any]:
    """Errors per sample type, in halves of the shape's longest side ([DDF22]'s unit), as its table `dataablation`.

    Returns:
      depth_l1: mean |d_{i*} - d| over visible samples; depth_l1_x10: times ten, as printed. visibility_bce: mean over
      all samples, natural logarithm. normal_angle_deg_median, _p95: between normals over the visible U, A and B samples
      (the types that L_n covers; the truth is known to under 1 degree), and `normal_angle_deg` of each type. NaN where
      nothing is visible.
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
        if kind in sample_types.ORDER[1:4]:
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
    """Mean, NaN of nothing."""
    return float(values.double().mean())


def _quantiles(values: Tensor) -> dict[str, float]:
    """Median and 95 %, NaN of nothing."""
    if not len(values):
        return {"median": math.nan, "p95": math.nan}
    middle, high = np.quantile(values.numpy(), [0.5, 0.95])
    return {"median": float(middle), "p95": float(high)}
