"""Settings of a fit, each changed alone: held-out errors after the same wall time.

The base is configs/fit.yaml. The shape is the Stanford bunny with 10,000 triangles, a procedural chair where its file
is absent. Every row samples, trains with a schedule of its own length and is asked for the six sample types; where a
step costs more, there are fewer.
"""

import argparse
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bench.fits import fit_curves
from bench.lib import display, measuring, overrides, side_by_side
from ddf.core import checks, config
from ddf.fit import fit_settings, fitting
from ddf.geometry import mesh_io

ON_DEMAND = "make fit-proof"
NAME = "fit_options"
CONFIG = Path("configs/fit.yaml")
MINUTES = 0.75  # of every fit
TRAINED_TOLERANCE = 0.5  # of errors from run to run: who trains for a time takes as many steps as the machine allows
BASE = "base"
# of configs/fit.yaml, which is the default
WIDTH, LAYERS = fit_settings.DEFAULT.field.hidden[0], len(fit_settings.DEFAULT.field.hidden)
BATCH = fit_settings.DEFAULT.batch
# what is changed, by the row's name: the key in the config's section `fit` and its other value
OPTIONS: Mapping[str, Mapping[str, Any]] = {
    BASE: {},
    "random start": {"start": "random"},
    "AdamW alone": {"loop.muon": None},
    "moving average of the weights": {"loop.ema": 0.995},
    "constant rate": {"loop.schedule": "constant"},
    "frequency 1": {"field.omega_first": 1.0},
    "frequency 6": {"field.omega_first": 6.0},
    "frequency 30": {"field.omega_first": 30.0},
    "bandwidth of directions as of positions": {"field.direction_scale": 1.0},
    "half the width": {"field.hidden": [WIDTH // 2] * LAYERS},
    "twice the width": {"field.hidden": [WIDTH * 2] * LAYERS},
    "three layers": {"field.hidden": [WIDTH] * 3},
    "seven layers": {"field.hidden": [WIDTH] * 7},
    "half the points a step": {"batch": {kind: count // 2 for kind, count in BATCH.items()}},
    "twice the points a step": {"batch": {kind: count * 2 for kind, count in BATCH.items()}},
    "bfloat16 products": {"loop.matmul": "bfloat16"},
    "squared depth loss": {"weights.depth_huber": None},
    "depth loss of the chosen": {"weights.depth_of": "chosen"},
    "depth loss of the mixture": {"weights.depth_of": "mixture"},
    "half the weight of depth": {"weights.depth": 2.5},
    "no normals": {"weights.normals": 0.0},
    "no eikonal": {"weights.eikonal_depth": 0.0, "weights.eikonal_visibility": 0.0},
    "depth by ReLU": {"field.depth_activation": "relu"},
    "in the cube": {"box": "cube"},
}


def section_of(name: str, minutes: float, threads: int) -> fit_settings.FitConfig:
    """The section `fit` of a row.

    Raises:
      InputError: the config already has the row's value.
    """
    section = overrides.changed(config.read(CONFIG)["fit"], OPTIONS[name], f"{CONFIG}: fit")
    found = config.parse(section, fit_settings.FitConfig, f"{CONFIG}: fit")
    return side_by_side.budgeted(found, minutes, threads)


def measure(name: str, mesh: mesh_io.Mesh, shape: str, minutes: float, threads: int) -> dict[str, Any]:
    """A row: seconds of sampling and training, and the held-out errors."""
    with tempfile.TemporaryDirectory() as folder:
        result = fitting.fit(mesh, section_of(name, minutes, threads), Path(folder))
    errors = fit_curves.errors(result["held_out"])
    row = measuring.row(name, {"shape": shape, "minutes": minutes}, [result["seconds"]], errors, TRAINED_TOLERANCE)
    return {**row, "steps": result["steps"], "parameters": result["parameters"]}


SECTION = display.Section(elsewhere="../fit_proof/README.md")


def main(given: Sequence[str]) -> None:
    """Fit with each setting and write the table; with --only, print the rows of some."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mesh", type=Path, help="default: the bunny, or a procedural chair where it is absent")
    parser.add_argument("--minutes", type=float, default=MINUTES, help=f"of each fit (default: {MINUTES})")
    side_by_side.add_rows(parser, OPTIONS)
    side_by_side.add_options(parser)
    arguments = parser.parse_args(given)
    if not arguments.minutes > 0:
        raise checks.InputError(f"--minutes must be > 0; got {arguments.minutes}")
    threads = side_by_side.threads(arguments, fit_curves.THREADS)
    names = arguments.only or list(OPTIONS)
    for name in names:
        section_of(name, arguments.minutes, threads)  # refused now rather than after an hour
    if arguments.side_by_side > 1:
        given = ["--minutes", str(arguments.minutes), "--threads", str(threads)]
        given += ["--mesh", str(arguments.mesh)] if arguments.mesh else []
        rows = side_by_side.rows(NAME, names, given, arguments.side_by_side)
    else:
        mesh, shape = fit_curves.target(arguments.mesh)
        rows = [measure(name, mesh, shape, arguments.minutes, threads) for name in names]
    side_by_side.deliver(NAME, arguments, threads, rows)
