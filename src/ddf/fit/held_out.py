"""Errors of a field of one shape on samples that it was not fitted to, as [DDF22] reports them."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float

from ddf.data.samples import sample_types
from ddf.fields import framed_field
from ddf.fit import shape_samples

CERTAIN = 6.9  # logit of 0.999, for a visibility that is 0 or 1: its cross-entropy would be infinite
# positions, directions -> depth, logits of visibility and normals, which are asked for by the flag
Ask = Callable[[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"], bool], tuple[np.ndarray, np.ndarray, np.ndarray]]


def errors(ask: Ask, samples: shape_samples.ShapeSamples) -> dict[str, Any]:
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
        faced, parts = kind in sample_types.ORDER[1:4], range(0, len(truth["depth"]), framed_field.CHUNK_RAYS)
        rows = [slice(first, first + framed_field.CHUNK_RAYS) for first in parts]
        answers = [ask(truth["positions"][part], truth["directions"][part], faced) for part in rows]
        depth, logits, normals = (np.concatenate(part) for part in zip(*answers, strict=True))
        visible = truth["visible"] > 0
        error = np.abs(depth.astype(np.float64) - truth["depth"])[visible] / samples.unit
        found["depth_l1"][kind] = mean(error)
        found["depth_l1_x10"][kind] = 10 * mean(error)
        found["visibility_bce"][kind] = mean(np.logaddexp(0, np.where(visible, -logits, logits).astype(np.float64)))
        if faced:
            angle = _angle_deg(normals[visible], truth["normals"][visible])
            found["normal_angle_deg"][kind] = _quantiles(angle)
            angles.append(angle)
    overall = _quantiles(np.concatenate(angles))
    found["normal_angle_deg_median"], found["normal_angle_deg_p95"] = overall["median"], overall["p95"]
    return found


def of_framed(field: framed_field.FramedField) -> Ask:
    """How a field is asked whose visibility is 0 or 1."""

    def ask(positions: np.ndarray, directions: np.ndarray, _: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        asked = field.evaluate(positions, directions, ("depth", "visibility", "normals"))
        return asked["depth"], CERTAIN * (2 * asked["visibility"] - 1), asked["normals"]

    return ask


def mean(values: np.ndarray) -> float:
    """Mean, NaN of nothing."""
    return float(values.mean()) if len(values) else math.nan


def _angle_deg(first: Float[np.ndarray, "n 3"], second: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
    first, second = first.astype(np.float64), second.astype(np.float64)
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(first, second), axis=1), (first * second).sum(axis=1)))


def _quantiles(values: np.ndarray) -> dict[str, float]:
    """Median and 95 %, NaN of nothing."""
    middle, high = np.quantile(values, [0.5, 0.95]) if len(values) else (math.nan, math.nan)
    return {"median": float(middle), "p95": float(high)}
