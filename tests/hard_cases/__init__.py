"""The hard cases: one list, read by the tests (tests/test_hard_cases.py) and by the page (bench/hard_cases.py)."""

from . import (
    camera_cases,
    cloud_cases,
    composition_cases,
    curvature_cases,
    field_cases,
    mesh_cases,
    ray_cases,
    training_cases,
)
from .case import DTYPES, Case, Outcome

GROUPS = (
    ray_cases.RAYS,
    mesh_cases.MESHES,
    camera_cases.CAMERAS,
    field_cases.FIELDS,
    curvature_cases.CURVATURE,
    cloud_cases.METRICS,
    cloud_cases.CLOUDS,
    composition_cases.SCENES,
    training_cases.TRAINING,
)
CASES: tuple[Case, ...] = tuple(case for group in GROUPS for case in group.cases)

__all__ = ["CASES", "DTYPES", "GROUPS", "Case", "Outcome"]
