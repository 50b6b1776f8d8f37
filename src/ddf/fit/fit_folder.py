"""The folder of a fit: who may write there, what an earlier fit left, and its mesh in [-1, 1]³."""

import contextlib
import hashlib
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ddf.core import checks, processes, storage
from ddf.fields import field_file
from ddf.geometry import mesh_io, scans, transforms
from ddf.models import loop_config

METRICS, PLAN, _LOCK = "fit.json", "plan.json", ".lock"


def digest(raw: mesh_io.Mesh | scans.Scan) -> str:
    """Of what a field is fitted to: SHA-256 of a mesh's or a scan's arrays."""
    of_scan = isinstance(raw, scans.Scan)
    told = (raw.positions, raw.directions, raw.ranges) if of_scan else (raw.vertices, raw.faces)
    return hashlib.sha256(b"".join(each.tobytes() for each in told)).hexdigest()


def owned(out_dir: Path) -> contextlib.AbstractContextManager[int]:
    """Keeps other fits out of a folder; InputError where one is at work there."""
    busy = f"{out_dir}: another fit (process {{number}}) is at work there; wait for it, or give another folder"
    return processes.locked(out_dir / _LOCK, busy, wait=False)


def plan_of(content: str, identity: str, out_dir: Path, force: bool) -> Mapping[str, Any]:
    """What an earlier run of the same fit wrote in the folder; of a new one, its mesh and who it is. InputError
    where the folder holds the field of another mesh or another model, and `force` does not say to replace it.
    """
    path = out_dir / PLAN
    plan = storage.read_json(path) if path.exists() else {}
    if not path.exists() and (out_dir / field_file.MODEL).exists() and not force:
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
        _, record = storage.load_tensors(out_dir / field_file.MODEL)
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
