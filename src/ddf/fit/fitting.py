"""Fitting one field to one mesh or to measured rays: samples in memory, held-out errors, steps or minutes.

A mesh is taken as it is: inner sheets and nested parts are part of the shape. It is moved to the field frame, and
training and held-out samples are drawn from random streams of their own. Source: [DDF22] §4.1, app. A and C.
Rays: `shape_samples`; some are held out.

Budget: `steps` is the reproducible way. `minutes` is the convenient one: a clock for sampling and training, which the
schedule follows (`loop_config.Clock`). Sampling takes at most `SAMPLING_SHARE` of it, with fewer samples on a machine
too slow or too busy for all of them. What was begun stands in `plan.json`, by which a folder is known again.
"""

import dataclasses
import functools
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from ddf.core import provenance, storage
from ddf.data.samples import sample_types
from ddf.fields import field_values, losses, model_files, pddf, shape_field
from ddf.fit import fit_folder, fit_settings, held_out, patch_fitting, shape_samples
from ddf.geometry import mesh_io, scans, transforms
from ddf.models import loop_config
from ddf.training import training_loop

FEW_STEPS = 500  # below so many a field is blurred whatever the shape: the user is told
SAMPLING_SHARE = 0.3  # of the minutes
_PROBE = 0.05  # of the samples, drawn once more to time them
_FLAT = 0.1  # share of a depth head's first weights that `start_flat` keeps


@torch.no_grad()
def start_flat(field: pddf.PDDF, samples: shape_samples.ShapeSamples) -> None:
    """Make both depths about the mean depth of the visible samples everywhere (derived here).

    From random heads of another mean all samples pull the depths the same way, so that an optimiser with momentum can
    carry them below zero at all points, where no gradient brings them back: the field then never has a depth.
    """
    visible = np.concatenate([part["depth"][part["visible"] > 0] for part in samples.arrays.values()])
    head = field.network.head
    head.weight[: pddf.NUM_COMPONENTS] *= _FLAT
    head.bias[: pddf.NUM_COMPONENTS] = held_out.mean(visible.astype(np.float64)) if len(visible) else 0.0


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


def _affordable(mesh: mesh_io.Mesh, config: fit_settings.FitConfig) -> float:
    """Share of the samples that `SAMPLING_SHARE` of the minutes allows, as drawing some of them tells; 1 without."""
    if config.steps is not None or config.minutes is None:
        return 1.0
    started = time.monotonic()
    shape_samples.draw_samples(mesh, config.drawing, sample_types.scaled(config.samples, _PROBE), "probe")
    allowed = 60 * SAMPLING_SHARE * config.minutes
    return min(1.0, max(_PROBE, _PROBE * allowed / (time.monotonic() - started)))


@dataclass(frozen=True)
class _Given:
    """What a field is fitted to: samples for a share of those asked for; errors of the folder's field, held out."""

    own_from_raw: transforms.Similarity
    weights: losses.LossWeights
    share: Callable[[], float]
    draw: Callable[[dict[str, int]], shape_samples.ShapeSamples]
    errors: Callable[[pddf.PDDF, Path], dict[str, Any]]


def _of_mesh(raw: mesh_io.Mesh, config: fit_settings.FitConfig, without: str | None) -> _Given:
    mesh, own_from_mesh = fit_folder.in_cube(raw)

    def draw(counts: dict[str, int]) -> shape_samples.ShapeSamples:
        samples = shape_samples.draw_samples(mesh, config.drawing, counts, "train", "samples")
        return samples if without is None else samples.without(without)

    def errors(field: pddf.PDDF, _: Path) -> dict[str, Any]:
        tested = shape_samples.draw_samples(mesh, config.drawing, sample_types.each(config.held_out), "held_out")
        return {"held_out": held_out_errors(field, tested)}

    return _Given(own_from_mesh, config.weights, lambda: _affordable(mesh, config), draw, errors)


def _of_rays(scan: scans.Scan, config: fit_settings.FitConfig) -> _Given:
    fused, split, facts = patch_fitting.fused(scan)
    mesh, own_from_scan = fit_folder.in_cube(fused.mesh)
    mesh, drawn = shape_samples.within(mesh, config.drawing, config.samples)
    field_from_scan = transforms.Similarity(1 - config.margin).compose(own_from_scan)

    def draw(counts: dict[str, int]) -> shape_samples.ShapeSamples:
        return shape_samples.draw_from_rays(split.kept, mesh, field_from_scan, drawn, sum(counts.values()))

    def errors(_: pddf.PDDF, out_dir: Path) -> dict[str, Any]:
        return {"held_out": split.errors(shape_field.load(out_dir)), **facts}

    return _Given(own_from_scan, shape_samples.ray_weights(config.weights), lambda: 1.0, draw, errors)


def fit(
    raw: mesh_io.Mesh | scans.Scan,
    config: fit_settings.FitConfig,
    out_dir: Path,
    source: Mapping[str, str] | None = None,
    without: str | None = None,
    *,
    threads: int | None = None,
    force: bool = False,
) -> dict[str, Any]:
    """Fit a field to a mesh or rays in their own frame; write model.safetensors (`shape_field.load`), log.csv and
    fit.json.

    Goes on in `out_dir` where an earlier run with the same mesh, config and code was stopped, or had fewer minutes.

    Args:
      source: name to checksum of the file that the mesh came from, for the record.
      without: a sample type that the field is not trained on; the held-out errors are of all six.
      threads: in place of those of the config, without being another fit.
      force: replace the field of another mesh in the folder.
    Returns:
      The content of fit.json: held_out (`held_out_errors`; of rays as of `patch_fitting.fit_rays`, with noise and
      seen), seconds (of all runs that led there), parameters, steps, samples (of training), seconds_per_step, box. And
      already: whether an earlier run had ended it.
    Raises:
      InputError: the mesh has no triangle with an area, another fit is at work in the folder, or it holds the field of
        another mesh.
    """
    with fit_folder.owned(out_dir):
        started = time.monotonic()
        content = fit_folder.digest(raw)
        names = [item.name for item in dataclasses.fields(config) if item.name != "minutes"]  # more of them go on
        recipe = {name: getattr(config, name) for name in names}
        identity = provenance.fingerprint([recipe, content, without], (), "ddf.fit.fitting")
        plan = fit_folder.plan_of(content, identity, out_dir, force)
        fingerprint = provenance.fingerprint([identity, config.steps])
        if sampled := plan.get("sampling_seconds"):
            earlier = fit_folder.finished(out_dir, fingerprint, _budget(config, sampled))
            if earlier is not None:
                return {**earlier, "already": True}
        training_loop.prepare(dataclasses.replace(config.loop, threads=threads or config.loop.threads))
        given = _of_rays(raw, config) if isinstance(raw, scans.Scan) else _of_mesh(raw, config, without)
        share = plan.get("samples_share") or given.share()
        drawn = sample_types.scaled(config.samples, share)
        samples = given.draw(drawn)
        field = pddf.PDDF(config.field).to(model_files.device())
        if config.start == "flat":
            start_flat(field, samples)
        trained = time.monotonic()
        sampling = plan.get("sampling_seconds") or trained - started
        storage.write_json(out_dir / fit_folder.PLAN, {**plan, "samples_share": share, "sampling_seconds": sampling})
        record = {
            "fingerprint": fingerprint,
            "seed": config.loop.seed,
            "sources": dict(source or {}),
            **shape_field.description(
                config.field,
                samples.lower,
                samples.upper,
                transforms.Similarity(samples.unit).compose(given.own_from_raw),
            ),
        }
        loss = functools.partial(step_loss, field, samples, dataclasses.replace(config, weights=given.weights))
        name = f"fit without {without}" if without else "fit"
        steps, seconds = training_loop.fit(
            field, _groups(field), loss, _budget(config, sampling), config.loop, out_dir, record, name
        )
        result = {
            **given.errors(field.eval(), out_dir),
            "seconds": sampling + seconds,
            "sampling_seconds": sampling,
            "parameters": pddf.count_parameters(field),
            "steps": steps,
            "samples": sum(drawn.values()),
            "seconds_per_step": seconds / steps,
            "box": {"lower": samples.lower.tolist(), "upper": samples.upper.tolist()},
        }
        storage.write_json(out_dir / fit_folder.METRICS, result)
        return {**result, "already": False}


def _budget(config: fit_settings.FitConfig, sampling: float) -> int | loop_config.Clock:
    """Steps, or the time that sampling leaves of the minutes."""
    return config.steps or loop_config.Clock(max(60 * (config.minutes or 0.0) - sampling, 1.0))


def held_out_errors(field: pddf.PDDF, samples: shape_samples.ShapeSamples) -> dict[str, Any]:
    """As `held_out.errors`."""

    @torch.no_grad()
    def ask(positions: np.ndarray, directions: np.ndarray, faced: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        p, v = (torch.from_numpy(values).to(field.network.head.weight) for values in (positions, directions))
        raw = field(p, v)
        normals = field_values.evaluate(field, p, v, ["normals"])["normals"] if faced else torch.zeros_like(p)
        depth, logits, normals = (x.cpu().numpy() for x in (field.depth(raw), raw[:, pddf.VISIBILITY_ROW], normals))
        return depth, logits, normals

    return held_out.errors(ask, samples)
