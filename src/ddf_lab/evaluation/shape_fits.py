"""Fits to one shape: which mesh, held-out errors beside the paper's, what each of the six sample types is worth.

fit.csv has the columns `type, metric, value, source`, ablate_samples.csv a first column `without`. Metrics: L1 x 10 of
depth and BCE of visibility per held-out type, ours and the paper's, and our angles of normals in degrees. For the
latter the same fit is made once without each type, and once with all: same shape, number of samples, steps and points
in a step. Source: [DDF22] app. `dataablation`.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from ddf.core import seeding, storage
from ddf.data.synthetic import assemble, chairs
from ddf.fit import fit_settings, fitting
from ddf.geometry import mesh_io
from ddf_lab.evaluation import paper_results

FIT, ABLATION = "fit.csv", "ablate_samples.csv"
MEASURED = "measured"
TYPES = paper_results.BUNNY_TYPES
ALL = "UAB"  # the types whose normals count: together
NONE = "none"  # nothing left out
RESULTS = "ablation.json"
SAMPLES, HELD_OUT = 500_000, 25_000  # of each fit, all types together; per type
MINUTES = 0.75  # of sampling and training, of the fit with all types; the others take as many steps
_FIT_FIELDS = ["type", "metric", "value", "source"]


def source_mesh(path: str | None, seed: int) -> tuple[mesh_io.Mesh, dict[str, str]]:
    """The mesh in its own frame, and name to checksum of its file; a chair that the seed decides, and {}, for None."""
    if path is None:
        random = seeding.generator(seed, "fit_shape")
        shape = assemble.shape(chairs.build(random), random)
        return mesh_io.Mesh(shape.vertices, shape.triangles), {}
    file = Path(path)
    return mesh_io.load(file), {file.name: storage.checksum(file)}


def without_type(config: fit_settings.FitConfig, without: str | None, steps: int | None) -> fit_settings.FitConfig:
    """The fit without one type: an equal part of `SAMPLES` of every other, or of all six.

    steps: of the fit with all types, once known; until then those of the config, or `MINUTES`.
    """
    each = SAMPLES // (len(TYPES) - (without is not None))
    drawn = {kind: 1 if kind == without else each for kind in TYPES}  # one that is dropped: none cannot be drawn
    steps = config.steps if steps is None else steps
    return dataclasses.replace(config, samples=drawn, held_out=HELD_OUT, steps=steps, minutes=MINUTES)


def leave_one_out(
    mesh: mesh_io.Mesh, config: fit_settings.FitConfig, out_dir: Path, source: Mapping[str, str] | None = None
) -> dict[str, dict[str, Any]]:
    """Fit seven fields into folders of `out_dir` and write ablation.json; a stopped run goes on where it was.

    Returns:
      By left-out type, `NONE` first: what `fitting.fit` returns, and `samples` in all.
    """
    results: dict[str, dict[str, Any]] = {}
    steps = None
    for without in (None, *TYPES):
        name = without or NONE
        chosen = without_type(config, without, steps)
        found = fitting.fit(mesh, chosen, out_dir / f"without_{name}", source, without, force=True)
        steps, drawn = found["steps"], sum(count for kind, count in chosen.samples.items() if kind != without)
        results[name] = {**found, "samples": drawn}
    storage.write_json(out_dir / RESULTS, results)
    return results


def fit_table(held_out: Mapping[str, Any]) -> pd.DataFrame:
    """fit.csv: ours and the paper's row of all six types, from `fitting.held_out_errors`."""
    together = {name: held_out[f"normal_angle_deg_{name}"] for name in ("median", "p95")}
    angles = [
        (kind, f"normal_angle_deg_{name}", own[name], MEASURED)
        for kind, own in {**held_out["normal_angle_deg"], ALL: together}.items()
        for name in together
    ]
    ours, papers = _rows(held_out, MEASURED), _rows(_paper(NONE), paper_results.BUNNY)
    return pd.DataFrame([*ours, *angles, *papers], columns=_FIT_FIELDS).astype({"value": float})


def ablation_table(results: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """ablate_samples.csv: ours and the paper's, from `leave_one_out`; `none`: all six types."""
    rows = [
        (without, *row)
        for without, found in results.items()
        for row in (*_rows(found["held_out"], MEASURED), *_rows(_paper(without), paper_results.BUNNY))
    ]
    return pd.DataFrame(rows, columns=["without", *_FIT_FIELDS]).astype({"value": float})


def _rows(errors: Mapping[str, Any], source: str) -> list[tuple[str, str, float | None, str]]:
    """None, of a mean over nothing, becomes NaN."""
    return [(kind, name, errors[name][kind], source) for name in paper_results.BUNNY_METRICS for kind in TYPES]


def _paper(without: str) -> dict[str, dict[str, float]]:
    return {name: dict(zip(TYPES, table[without], strict=True)) for name, table in paper_results.BUNNY_METRICS.items()}
