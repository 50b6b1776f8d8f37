"""Patches of one mesh (`fields.grid`), with held-out errors: nothing is trained, it takes seconds."""

import hashlib
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ddf.core import provenance, storage
from ddf.data.samples import sample_types
from ddf.fields import model_files
from ddf.fields.grid import octree, patch_field
from ddf.fit import fit_settings, fitting, shape_samples
from ddf.geometry import mesh_io


def patches(raw: mesh_io.Mesh, config: octree.PatchConfig) -> patch_field.PatchField:
    """The field of a mesh, in its frame; it has no errors and no file.

    Raises:
      InputError: the mesh has no triangle with an area.
    """
    return patch_field.of(*patch_field.fitted(*fitting.in_cube(raw), config))


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
      The content of fit.json: held_out (`fitting.held_out_errors`), seconds, parameters (numbers stored), steps (0),
      patches, bytes (of the arrays), box. And already: whether an earlier run had made it, which `force` never is.
    Raises:
      InputError: the mesh has no triangle with an area, another fit is at work in the folder, or it holds the field of
        another mesh.
    """
    with fitting.owned(out_dir):
        started = time.monotonic()
        content = hashlib.sha256(raw.vertices.tobytes() + raw.faces.tobytes()).hexdigest()
        identity = provenance.fingerprint([config, content], (), "ddf.fit.patch_fitting")
        plan = fitting.plan_of(content, identity, out_dir, force)
        if not force and (earlier := fitting.finished(out_dir, identity)) is not None:
            return {**earlier, "already": True}
        mesh, own_from_mesh = fitting.in_cube(raw)
        arrays, description = patch_field.fitted(mesh, own_from_mesh, config)
        seconds = time.monotonic() - started
        field = patch_field.of(arrays, description)
        record = {"fingerprint": identity, "seed": 0, "sources": dict(source or {}), **description}
        asked = fit_settings.FitConfig()
        truth, _ = shape_samples.draw_samples(mesh, asked, sample_types.each(asked.held_out), "held_out")
        result = {
            "held_out": fitting.held_out_errors(field, truth),
            "seconds": seconds,
            "parameters": sum(values.size for values in arrays.values()),
            "steps": 0,
            "patches": len(field.tree.codes),
            "bytes": sum(values.nbytes for values in arrays.values()),
            "box": description["box"],
        }
        for stale in ("field.onnx", "log.csv"):
            (out_dir / stale).unlink(missing_ok=True)
        storage.write_json(out_dir / fitting.PLAN, dict(plan))
        storage.save_tensors(out_dir / model_files.MODEL, arrays, record)
        storage.write_json(out_dir / fitting.METRICS, result)
        return {**result, "already": False}
