"""Patches (`fields.grid`) of a mesh or of measured rays, with held-out errors: nothing is trained, it takes seconds."""

import logging
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ddf.core import checks, provenance, seeding, storage
from ddf.data.samples import sample_types
from ddf.fields import field_file, framed_field
from ddf.fields.grid import octree, patch_field
from ddf.fit import fit_folder, held_out, shape_samples
from ddf.geometry import fused_rays, mesh_io, rays, scans

LOGGER = logging.getLogger(__name__)
HELD_OUT, MOST_HELD_OUT = 0.02, 50_000  # of the rays: for the errors
OF_NOISE = 0.05  # of the noise of rays: the tolerance of patches, where it is more than theirs
OFF, SIGMAS = 0.01, 3.0  # of the longest side, and deviations of the noise: from which on the depth of a ray is wrong
_Made = tuple[tuple[dict[str, np.ndarray], dict[str, Any]], Callable[[patch_field.PatchField], dict[str, Any]]]


def patches(raw: mesh_io.Mesh, config: octree.PatchConfig | None = None) -> patch_field.PatchField:
    """The field of a mesh, in its frame; it has no errors and no file. InputError where no triangle has an area."""
    return patch_field.of(*patch_field.fitted(*fit_folder.in_cube(raw), config or octree.PatchConfig()))


def fit(
    raw: mesh_io.Mesh,
    config: octree.PatchConfig,
    out_dir: Path,
    source: Mapping[str, str] | None = None,
    *,
    force: bool = False,
) -> dict[str, Any]:
    """Write model.safetensors and fit.json; what an earlier fit left there goes.

    Args:
      source: name to checksum of the file that the mesh came from, for the record.
      force: replace the field of another mesh in the folder.
    Returns:
      The content of fit.json: held_out (`held_out.errors`), seconds, parameters (numbers stored), steps (0),
      patches, bytes (of the arrays), box. And already: whether an earlier run had made it, which `force` never is.
    Raises:
      InputError: the mesh has no triangle with an area, another fit is at work in the folder, or it holds the field of
        another mesh.
    """

    def make() -> _Made:
        mesh, own_from_mesh = fit_folder.in_cube(raw)

        def errors(field: patch_field.PatchField) -> dict[str, Any]:
            counts = sample_types.each(shape_samples.HELD_OUT)
            truth = shape_samples.draw_samples(mesh, shape_samples.Drawing(), counts, "held_out")
            return {"held_out": held_out.errors(held_out.of_framed(field), truth)}

        return patch_field.fitted(mesh, own_from_mesh, config), errors

    return _written([config], raw, out_dir, source, force, make)


def fit_rays(
    scan: scans.Scan,
    tolerance: float | None,
    out_dir: Path,
    source: Mapping[str, str] | None = None,
    *,
    sensed: bool = True,
    force: bool = False,
) -> dict[str, Any]:
    """As `fit`, of the surface that rays have in common, `fused_rays.fuse`; what they saw is told by `PatchField.seen`.

    Args:
      tolerance: of patches, of half the longest side; None: `OF_NOISE` of the noise, or that of meshes if it is more.
      sensed: whether the rays tell what is free, and not only where the surface is.
    Returns:
      As `fit`; held_out is of `HELD_OUT` of the rays, which the field is not fitted to: `ray_errors`. And noise:
      deviation of hits across the surface; seen: share of the box that rays passed through; both in fit.json.
    Raises:
      InputError: too few rays ended on something, another fit is at work in the folder, or it holds another field.
    """

    def make() -> _Made:
        surface, split, facts = fused(scan, sensed, "".join(f"{name}: " for name in source or ()))

        def errors(field: patch_field.PatchField) -> dict[str, Any]:
            return {"held_out": split.errors(field), **facts}

        return of_fused(surface, tolerance), errors

    return _written(["rays", tolerance, sensed], scan, out_dir, source, force, make)


@dataclass(frozen=True)
class Split:
    """The rays that a field is fitted to, and those that it is measured on; off: as of `ray_errors`."""

    kept: scans.Scan
    left: scans.Scan
    off: float

    def errors(self, field: framed_field.FramedField) -> dict[str, float]:
        """As `ray_errors`."""
        return ray_errors(field, self.left, self.off)


def fused(scan: scans.Scan, sensed: bool = True, whose: str = "") -> tuple[fused_rays.Fused, Split, dict[str, float]]:
    """The surface that `HELD_OUT` less of the rays share, both parts, what `fit_rays` tells; `whose` begins errors."""
    random, count = seeding.generator(0, "rays held out"), len(scan.ranges)  # no stream that a cloud was drawn by
    kept = random.random(count) >= min(HELD_OUT, MOST_HELD_OUT / max(1, count))
    try:
        found = fused_rays.fuse(scan.some(kept), sensed)
    except checks.InputError as error:
        raise checks.InputError(f"{whose}{error}") from error
    facts = {"noise": found.noise, "seen": float(found.passed.mean())}
    LOGGER.info(
        "cells of %.3g, hits %.2g off the surface (deviation); rays passed %.0f%% of the space around",
        *(found.cell, found.noise, 100 * facts["seen"]),
    )
    off = OFF * float(np.ptp(found.mesh.box(), axis=0).max()) + SIGMAS * found.noise
    return found, Split(scan.some(kept), scan.some(~kept), off), facts


def of_fused(fused: fused_rays.Fused, tolerance: float | None = None) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Patches of what rays have in common, as of `patch_field.fitted`; tolerance as of `fit_rays`."""
    mesh, own_from_mesh = fit_folder.in_cube(fused.mesh)
    least = max(octree.PatchConfig.tolerance, OF_NOISE * fused.noise * own_from_mesh.scale)
    config = octree.PatchConfig(least if tolerance is None else tolerance)
    return patch_field.fitted(mesh, own_from_mesh, config, fused.evidence)


def ray_errors(field: framed_field.FramedField, scan: scans.Scan, off: float) -> dict[str, float]:
    """How a field answers measured rays, in their unit; NaN of nothing.

    Returns:
      depth_median: of |depth - range| where both meet something. wrong: share of rays whose visibility is wrong, or
      whose depth is off by more than `off`. rays: how many.
    """
    asked = rays.OrientedPoints(scan.positions, scan.directions)
    depth = framed_field.query(field, asked, ("depth",))[0]["depth"]
    both = np.isfinite(depth) & scan.hit
    error = np.abs(depth[both] - scan.ranges[both])
    wrong = np.isfinite(depth) != scan.hit
    wrong[both] = error > off
    known = len(wrong) > 0
    median = float(np.median(error)) if len(error) else np.nan
    return {"depth_median": median, "wrong": float(wrong.mean()) if known else np.nan, "rays": len(wrong)}


def _written(
    facts: list[Any],
    raw: mesh_io.Mesh | scans.Scan,
    out_dir: Path,
    source: Mapping[str, str] | None,
    force: bool,
    make: Callable[[], _Made],
) -> dict[str, Any]:
    """The folder of a fit, as of `fit`; make: its arrays, its record, and how its errors are told."""
    with fit_folder.owned(out_dir):
        started = time.monotonic()
        told = fit_folder.digest(raw)
        identity = provenance.fingerprint([*facts, told], (), "ddf.fit.patch_fitting")
        plan = fit_folder.plan_of(told, identity, out_dir, force)
        if not force and (earlier := fit_folder.finished(out_dir, identity)) is not None:
            return {**earlier, "already": True}
        (arrays, description), errors = make()
        seconds = time.monotonic() - started
        field = patch_field.of(arrays, description)
        record = {"fingerprint": identity, "seed": 0, "sources": dict(source or {}), **description}
        result = {
            **errors(field),
            "seconds": seconds,
            "parameters": sum(values.size for values in arrays.values()),
            "steps": 0,
            "patches": len(field.tree.codes),
            "bytes": sum(values.nbytes for values in arrays.values()),
            "box": description["box"],
        }
        for stale in ("log.csv", "fit.png"):
            (out_dir / stale).unlink(missing_ok=True)
        storage.write_json(out_dir / fit_folder.PLAN, dict(plan))
        storage.save_tensors(out_dir / field_file.MODEL, arrays, record)
        storage.write_json(out_dir / fit_folder.METRICS, result)
        return {**result, "already": False}
