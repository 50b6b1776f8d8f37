"""The tables of the single-shape page, from the long tables of `shape_errors`."""

from collections.abc import Mapping

import pandas as pd

from ddf.fit import field_diagnostics
from ddf_lab.evaluation.shape import leave_one_out, paper_ablation
from ddf_lab.evaluation.shape.fit_errors import ALL, MEASURED, TYPES
from ddf_lab.report import pages

METRIC_NAMES = {"depth_l1_x10": "L1 × 10 of depth", "visibility_bce": "BCE of visibility"}
_DIAGNOSTICS = {
    "eikonal_depth": ("directed eikonal, depth", "|∇<sub>p</sub>d · v + 1|"),
    "eikonal_visibility": ("directed eikonal, visibility", "|∇<sub>p</sub>ξ · v|"),
    "gradient_consistency": ("gradient consistency", "‖(∇<sub>v</sub>d - d ∇<sub>p</sub>d)(I - vvᵀ)‖"),
    "view_depth": ("view consistency, depth", "max(0, d(p₂, v₂) - t)"),
    "view_visibility": ("view consistency, visibility", "1 - ξ(p₂, v₂)"),
}


def errors(table: pd.DataFrame, caption: str) -> pages.Table:
    """Depth and visibility of fit.csv as printed: ours and the paper's per metric, a column per held-out type."""
    rows: list[list[pages.Cell | str]] = []
    for metric, name in METRIC_NAMES.items():
        for source in (MEASURED, paper_ablation.SOURCE):
            own = table[(table["metric"] == metric) & (table["source"] == source)].set_index("type")["value"]
            rows.append([name, "here" if source == MEASURED else source, *(number(own[kind]) for kind in TYPES)])
    return pages.Table(caption, ["", "", *(f"held-out {kind}" for kind in TYPES)], rows, labels=2)


def angles(table: pd.DataFrame, caption: str) -> pages.Table:
    """Normals of fit.csv as printed: a column per held-out type that has true normals, and of all these together."""
    found = {
        name: table[table["metric"] == f"normal_angle_deg_{metric}"].set_index("type")["value"]
        for metric, name in (("median", "median"), ("p95", "95 %"))
    }
    kinds = [kind for kind in (*TYPES, ALL) if kind in found["median"]]
    rows = [[name, *(number(own[kind], "°", 1) for kind in kinds)] for name, own in found.items()]
    header = ["", *(f"held-out {'U, A, B' if kind == ALL else kind}" for kind in kinds)]
    return pages.Table(caption, header, rows)


def ablation(table: pd.DataFrame, metric: str, source: str, caption: str) -> pages.Table:
    """One metric of ablate_samples.csv: a row per left-out type, a column per held-out type.

    The largest error of every column is bold.
    """
    values = _left_out_by_held_out(table, metric, source)
    rows: list[list[pages.Cell | str]] = []
    for without in (*TYPES, leave_one_out.NONE):
        worst = [bool(values.loc[without, kind] == values[kind].max()) for kind in TYPES]
        cells = [pages.Cell(number(values.loc[without, kind]), best) for kind, best in zip(TYPES, worst, strict=True)]
        rows.append([without, *cells])
    return pages.Table(caption, ["left out", *(f"held-out {kind}" for kind in TYPES)], rows)


def worst_for_itself(table: pd.DataFrame, metric: str, source: str) -> list[str]:
    """The held-out types whose largest error is that of the fit without them."""
    values = _left_out_by_held_out(table, metric, source)
    return [kind for kind in TYPES if values.loc[kind, kind] == values[kind].max()]


def _left_out_by_held_out(table: pd.DataFrame, metric: str, source: str) -> pd.DataFrame:
    part = table[(table["metric"] == metric) & (table["source"] == source)]
    return part.pivot(index="without", columns="type", values="value")


def diagnostics(found: Mapping[str, Mapping[str, float]], caption: str) -> pages.Table:
    """Residuals of `field_diagnostics.measure`."""
    rows: list[list[pages.Cell | str]] = []
    for name in field_diagnostics.NAMES:
        title, formula = _DIAGNOSTICS[name]
        values = [number(found[name][key]) for key in ("median", "p95", "worst")]
        rows.append([title, formula, *values, f"{found[name]['rays']:,}"])
    header = ["", "0 for an exact field", "median", "95 %", "worst", "rays"]
    return pages.Table(caption, header, rows, labels=2)


def number(value: float | None, unit: str = "", digits: int | None = None) -> str:
    """Two decimals, as the paper prints, more where that says 0, or `digits`; a dash for a mean over nothing."""
    if value is None or pd.isna(value):
        return "–"
    if digits is None:
        return f"{value:.2f}" if value == 0 or abs(value) >= 0.095 else f"{value:.2g}"
    return f"{value:.{digits}f}{unit}"
