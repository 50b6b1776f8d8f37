"""The held-out errors of fits to one shape as long tables, ours and the paper's: fit.csv and ablate_samples.csv.

fit.csv has the columns `type, metric, value, source`, ablate_samples.csv a first column `without`. Metrics: L1 x 10 of
depth and BCE of visibility per held-out type, ours and the paper's, and our angles of normals in degrees.
"""

import math
from collections.abc import Mapping
from typing import Any

import pandas as pd

from ddf_lab.evaluation.shape import leave_one_out, paper_ablation

FIT, ABLATION = "fit.csv", "ablate_samples.csv"
MEASURED = "measured"
TYPES = paper_ablation.COLUMNS
ALL = "UAB"  # the types whose normals count: together
_FIT_FIELDS = ["type", "metric", "value", "source"]


def fit_table(held_out: Mapping[str, Any]) -> pd.DataFrame:
    """fit.csv: `type, metric, value, source`, ours and the paper's row of all six types.

    Args:
      held_out: of `fitting.held_out_errors`.
    """
    rows = _error_rows(held_out)
    for kind, angles in (*held_out["normal_angle_deg"].items(), (ALL, None)):
        for name in ("median", "p95"):
            value = held_out[f"normal_angle_deg_{name}"] if angles is None else angles[name]
            rows.append((kind, f"normal_angle_deg_{name}", _number(value), MEASURED))
    rows += _paper_rows(leave_one_out.NONE)
    return pd.DataFrame(rows, columns=_FIT_FIELDS)


def ablation_table(results: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """ablate_samples.csv: `without, type, metric, value, source`, ours and the paper's; `none`: all six types.

    Args:
      results: of `leave_one_out.run`.
    """
    rows = [
        (without, *row)
        for without, found in results.items()
        for row in (*_error_rows(found["held_out"]), *_paper_rows(without))
    ]
    return pd.DataFrame(rows, columns=["without", *_FIT_FIELDS])


def _error_rows(held_out: Mapping[str, Any]) -> list[tuple[str, str, float, str]]:
    return [
        (kind, metric, _number(held_out[metric][kind]), MEASURED) for metric in paper_ablation.METRICS for kind in TYPES
    ]


def _number(value: float | None) -> float:
    """NaN for a mean over nothing, which is null in JSON."""
    return math.nan if value is None else value


def _paper_rows(without: str) -> list[tuple[str, str, float, str]]:
    return [
        (kind, metric, value, paper_ablation.SOURCE)
        for metric, table in paper_ablation.METRICS.items()
        for kind, value in zip(paper_ablation.COLUMNS, table[without], strict=True)
    ]
