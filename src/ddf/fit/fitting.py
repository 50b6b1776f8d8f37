"""Fitting one field to one mesh: six sample types in memory, held-out errors, a budget of steps or of minutes.

The mesh is taken as it is: inner sheets and nested parts are part of the shape. It is moved to the field frame, and
training and held-out samples are drawn from random streams of their own. Source: [DDF22] §4.1, app. A and C.

Budget: `steps` is the reproducible way. `minutes` is the convenient one: a clock for sampling and training, which the
schedule follows (`loop_config.Clock`). Sampling takes at most `SAMPLING_SHARE` of it, with fewer samples on a machine
too slow or too busy for all of them. What was begun stands in `plan.json`, by which a folder is known again.
"""

import contextlib
import dataclasses
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

from ddf.core import checks, processes, provenance, storage
from ddf.data.samples import sample_types
from ddf.fields import field_values, framed_field, losses, model_files, pddf, shape_field
from ddf.fit import fit_settings, shape_samples
from ddf.geometry import mesh_io, transforms
from ddf.models import loop_config
from ddf.training import training_loop

METRICS, PLAN, _LOCK = "fit.json", "plan.json", ".lock"
FEW_STEPS = 500  # below so many a field is blurred whatever the shape: the user is told
SAMPLING_SHARE = 0.3  # of the minutes
CERTAIN = 6.9  # logit of 0.999, for a visibility that is 0 or 1: its cross-entropy would be infinite
_PROBE = 0.05  # of the samples, drawn once more to time them
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
    return losses.shape_loss(field, batch, None, config.weights)


def _groups(field: pddf.PDDF) -> list[dict[str, Any]]:
    """Without decay AdamW is Adam."""
    return [{"params": list(field.parameters()), "weight_decay": 0.0}]


def owned(out_dir: Path) -> contextlib.AbstractContextManager[int]:
    """Keeps other fits out of a folder; InputError where one is at work there."""
    busy = f"{out_dir}: another fit (process {{number}}) is at work there; wait for it, or give another folder"
    return processes.locked(out_dir / _LOCK, busy, wait=False)


def plan_of(content: str, identity: str, out_dir: Path, force: bool) -> Mapping[str, Any]:
    """What an earlier run of the same fit wrote in the folder; of a new one, its mesh and who it is.

    Raises:
      InputError: the folder holds the field of another mesh or another model, and `force` does not say to replace it.
    """
    path = out_dir / PLAN
    plan = storage.read_json(path) if path.exists() else {}
    if not path.exists() and (out_dir / model_files.MODEL).exists() and not force:
        raise checks.InputError(
            f"{out_dir}: holds a model that no fit wrote; give another folder, or --force to replace it"
        )
    if plan.get("mesh", content) != content and not force:
        raise checks.InputError(
            f"{out_dir}: holds the field of another mesh; give another folder, or --force to replace it"
        )
    if plan.get("fingerprint") != identity:
        plan = {"fingerprint": identity, "mesh": content}
    return plan


def finished(out_dir: Path, fingerprint: str, budget: int | loop_config.Clock | None = None) -> dict[str, Any] | None:
    """The content of fit.json where this fit, with this budget or more, ended before and its field is whole."""
    try:
        _, record = storage.load_tensors(out_dir / model_files.MODEL)
        found = _nan_for_null(storage.read_json(out_dir / METRICS))
    except (FileNotFoundError, checks.InputError):
        return None
    if record.get("fingerprint") != fingerprint or record.get("steps", 0) != found["steps"]:
        return None
    if isinstance(budget, loop_config.Clock):
        return found if found["seconds"] - found["sampling_seconds"] >= budget.seconds else None
    return found if budget in (None, found["steps"]) else None


def _nan_for_null(data: Any) -> Any:
    """What `storage.write_json` was given."""
    if isinstance(data, dict):
        return {key: _nan_for_null(value) for key, value in data.items()}
    return math.nan if data is None else data


def in_cube(raw: mesh_io.Mesh) -> tuple[mesh_io.Mesh, transforms.Similarity]:
    """A mesh in [-1, 1]³, its longest side 2, and the map that brought it there."""
    own_from_mesh = transforms.field_from_mesh(raw.surface_vertices())
    inside = np.clip(own_from_mesh.apply(raw.vertices), -1.0, 1.0)
    kept = mesh_io.without_flat(raw).faces  # clipped, a far flat triangle could gain an area
    return mesh_io.Mesh(inside, kept), own_from_mesh


def _affordable(mesh: mesh_io.Mesh, config: fit_settings.FitConfig) -> float:
    """Share of the samples that `SAMPLING_SHARE` of the minutes allows, as drawing some of them tells; 1 without."""
    if config.steps is not None or config.minutes is None:
        return 1.0
    started = time.monotonic()
    shape_samples.draw_samples(mesh, config, sample_types.scaled(config.samples, _PROBE), "probe")
    allowed = 60 * SAMPLING_SHARE * config.minutes
    return min(1.0, max(_PROBE, _PROBE * allowed / (time.monotonic() - started)))


def fit(
    raw: mesh_io.Mesh,
    config: fit_settings.FitConfig,
    out_dir: Path,
    source: Mapping[str, str] | None = None,
    without: str | None = None,
    *,
    threads: int | None = None,
    force: bool = False,
) -> dict[str, Any]:
    """Fit a field to a mesh in its own frame; write model.safetensors (`shape_field.load`), log.csv and fit.json.

    Goes on in `out_dir` where an earlier run with the same mesh, config and code was stopped, or had fewer minutes.

    Args:
      source: name to checksum of the file that the mesh came from, for the record.
      without: a sample type that the field is not trained on; the held-out errors are of all six.
      threads: in place of those of the config, without being another fit.
      force: replace the field of another mesh in the folder.
    Returns:
      The content of fit.json: held_out (`held_out_errors`), seconds (of all runs that led there), parameters,
      steps, samples (of training), seconds_per_step, box. And already: whether an earlier run had ended it.
    Raises:
      InputError: the mesh has no triangle with an area, another fit is at work in the folder, or it holds the field of
        another mesh.
    """
    with owned(out_dir):
        started = time.monotonic()
        content = hashlib.sha256(raw.vertices.tobytes() + raw.faces.tobytes()).hexdigest()
        names = [item.name for item in dataclasses.fields(config) if item.name != "minutes"]  # more of them go on
        recipe = {name: getattr(config, name) for name in names}
        identity = provenance.fingerprint([recipe, content, without], (), "ddf.fit.fitting")
        plan = plan_of(content, identity, out_dir, force)
        fingerprint = provenance.fingerprint([identity, config.steps])
        if sampled := plan.get("sampling_seconds"):
            earlier = finished(out_dir, fingerprint, _budget(config, sampled))
            if earlier is not None:
                return {**earlier, "already": True}
        training_loop.prepare(dataclasses.replace(config.loop, threads=threads or config.loop.threads))
        mesh, own_from_mesh = in_cube(raw)
        share = plan.get("samples_share") or _affordable(mesh, config)
        drawn = sample_types.scaled(config.samples, share)
        samples, packing_errors = shape_samples.draw_samples(mesh, config, drawn, "train", "samples")
        samples = samples if without is None else samples.without(without)
        field = pddf.PDDF(config.field).to(model_files.device())
        if config.start == "flat":
            start_flat(field, samples)
        trained = time.monotonic()
        sampling = plan.get("sampling_seconds") or trained - started
        storage.write_json(out_dir / PLAN, {**plan, "samples_share": share, "sampling_seconds": sampling})
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
        name = f"fit without {without}" if without else "fit"
        steps, seconds = training_loop.fit(
            field, _groups(field), loss, _budget(config, sampling), config.loop, out_dir, record, name
        )
        held_out, _ = shape_samples.draw_samples(mesh, config, sample_types.each(config.held_out), "held_out")
        result = {
            "held_out": held_out_errors(field.eval(), held_out),
            "seconds": sampling + seconds,
            "sampling_seconds": sampling,
            "parameters": pddf.count_parameters(field),
            "steps": steps,
            "samples": sum(drawn.values()),
            "seconds_per_step": seconds / steps,
            "box": {"lower": samples.lower.tolist(), "upper": samples.upper.tolist()},
        }
        storage.write_json(out_dir / METRICS, result)
        return {**result, "already": False}


def _budget(config: fit_settings.FitConfig, sampling: float) -> int | loop_config.Clock:
    """Steps, or the time that sampling leaves of the minutes."""
    return config.steps or loop_config.Clock(max(60 * (config.minutes or 0.0) - sampling, 1.0))


@torch.no_grad()
def held_out_errors(field: pddf.PDDF | framed_field.FramedField, samples: shape_samples.ShapeSamples) -> dict[str, Any]:
    """Errors per sample type, in halves of the shape's longest side ([DDF22]'s unit), as its table `dataablation`.

    Returns:
      depth_l1: mean |d_{i*} - d| over visible samples; depth_l1_x10: times ten, as printed. visibility_bce: mean over
      all samples, natural logarithm; patches are taken to be `CERTAIN`. normal_angle_deg_median, _p95: between normals
      over the visible U, A and B samples (the types that L_n covers; the truth is known to under 1 degree), and
      `normal_angle_deg` of each type. NaN where nothing is visible.
    """
    found: dict[str, Any] = {"depth_l1": {}, "depth_l1_x10": {}, "visibility_bce": {}, "normal_angle_deg": {}}
    angles = []
    for kind, truth in samples.arrays.items():
        points = (truth["positions"].split(framed_field.CHUNK_RAYS), truth["directions"].split(framed_field.CHUNK_RAYS))
        faced = kind in sample_types.ORDER[1:4]
        answers = [_ask(field, p, v, faced) for p, v in zip(*points, strict=True)]
        depth, logits, *normals = (torch.cat(part).cpu() for part in zip(*answers, strict=True))
        visible = truth["visible"] > 0
        error = (depth - truth["depth"])[visible].abs() / samples.unit
        found["depth_l1"][kind] = _mean(error)
        found["depth_l1_x10"][kind] = 10 * _mean(error)
        found["visibility_bce"][kind] = float(functional.binary_cross_entropy_with_logits(logits, truth["visible"]))
        if faced:
            angle = _angle_deg(normals[0][visible], truth["normals"][visible])
            found["normal_angle_deg"][kind] = _quantiles(angle)
            angles.append(angle)
    overall = _quantiles(torch.cat(angles))
    found["normal_angle_deg_median"], found["normal_angle_deg_p95"] = overall["median"], overall["p95"]
    return found


def _ask(
    field: pddf.PDDF | framed_field.FramedField,
    positions: Float[Tensor, "n 3"],
    directions: Float[Tensor, "n 3"],
    faced: bool,
) -> list[Tensor]:
    """Depth, logits of visibility and, if wanted, normals."""
    if isinstance(field, pddf.PDDF):
        p, v = (values.to(field.network.head.weight) for values in (positions, directions))
        raw = field(p, v)
        normals = [field_values.evaluate(field, p, v, ["normals"])["normals"]] if faced else []
        return [field.depth(raw), raw[:, pddf.VISIBILITY_ROW], *normals]
    asked = field.evaluate(positions.numpy(), directions.numpy(), ("depth", "visibility", "normals"))
    depth, visible, normals = (torch.from_numpy(asked[name]).float() for name in ("depth", "visibility", "normals"))
    return [depth, CERTAIN * (2 * visible - 1), normals][: 3 if faced else 2]


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
