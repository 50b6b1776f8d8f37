"""What each of the six sample types is worth: the same fit once without each of them, and once with all.

Every fit has the same shape, number of samples, steps and points in a step. Source: [DDF22] app. `dataablation`.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ddf.core import storage
from ddf.fit import fit_settings, fitting
from ddf.geometry import mesh_io
from ddf_lab.evaluation.shape import paper_ablation

NONE = "none"  # nothing left out
RESULTS = "ablation.json"
SAMPLES, HELD_OUT = 500_000, 25_000  # of each fit, all types together; per type. Source: [DDF22] app. `dataablation`
MINUTES = 0.75  # of sampling and training, of the fit with all types; the others take as many steps


def settings(config: fit_settings.FitConfig, without: str | None, steps: int | None) -> fit_settings.FitConfig:
    """The fit without one type: an equal part of `SAMPLES` of every other, or of all six.

    Args:
      steps: of the fit with all types, once known; until then those of the config, or `MINUTES`.
    """
    each = SAMPLES // (len(paper_ablation.COLUMNS) - (without is not None))
    drawn = {
        kind: 1 if kind == without else each for kind in paper_ablation.COLUMNS
    }  # one that is dropped: none cannot be drawn
    return dataclasses.replace(
        config,
        samples=drawn,
        held_out=HELD_OUT,
        steps=config.steps if steps is None else steps,
        minutes=MINUTES,
    )


def run(
    mesh: mesh_io.Mesh, config: fit_settings.FitConfig, out_dir: Path, source: Mapping[str, str] | None = None
) -> dict[str, dict[str, Any]]:
    """Fit seven fields into folders of `out_dir` and write ablation.json; a stopped run goes on where it was.

    Returns:
      By left-out type, `NONE` first: what `fitting.fit` returns, and `samples` in all.
    """
    results: dict[str, dict[str, Any]] = {}
    steps = None
    for without in (None, *paper_ablation.COLUMNS):
        name = without or NONE
        chosen = settings(config, without, steps)
        found = fitting.fit(mesh, chosen, out_dir / f"without_{name}", source, without, force=True)
        steps = found["steps"]
        drawn = sum(count for kind, count in chosen.samples.items() if kind != without)
        results[name] = {**found, "samples": drawn}
    storage.write_json(out_dir / RESULTS, results)
    return results
