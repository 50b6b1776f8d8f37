"""One shape fitted in several ways: held-out errors of all six sample types against seconds, at times that grow
geometrically. Seconds are those of training; sampling and evaluations are not counted.

Each way is one of `RECIPES`, fitted by `ddf.fit.fitting.fit` as `ddf fit` does it; the paper's recipe gets as long
as the longest of the others. The shape is the Stanford bunny with 10,000 triangles, a procedural chair where its file
is absent. A stopped run goes on from its checkpoints in artifacts/fit_curves. `--only long_fit` fits in one
way alone and prints its twelve figures beside the paper's.
"""

import argparse
import dataclasses
import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import torch
from torch import Tensor

from bench.lib import curve_reach, display, growth_curves, measuring, side_by_side
from ddf.core import checks, config, storage
from ddf.data import mesh_config, mesh_preparation
from ddf.data.samples import sample_types
from ddf.fields import pddf
from ddf.fit import fit_settings, fitting, shape_samples
from ddf.geometry import mesh_io
from ddf.training import training_loop
from ddf_lab.evaluation.shape import leave_one_out, paper_ablation, source_mesh

ON_DEMAND = "make fit-proof"
NAME = "fit_curves"
PAPER = "paper_fit"  # the recipe of [DDF22] app. C
LIKE = "like_for_like"  # `long_fit` on the data of the paper's row: 83,333 samples a type, no margin, T cast
OURS = ("fit", "long_fit", LIKE)
RECIPES = (*OURS, PAPER)  # `LIKE`, and files of configs/
THREADS = 2  # of each way, unless it is told
BUNNY, FACES = measuring.REAL_MESHES / "bunny_60k.obj", 10_000
OUT = Path("artifacts") / NAME
CURVE = "curve.json"
FIRST_SECONDS, FACTOR = 1.0, 1.5  # the first evaluation, and the times from one to the next
HELD_OUT, FINAL_HELD_OUT = 10_000, 25_000  # of each type: for the curve, and at its end, as in the paper
DRAWN = ("A", "U", "S")  # types in the picture
COMPARED = "depth_l1_x10_A"  # the error that the times are to
LOG_EVERY = 50  # steps; those since the last entry are not on the clock of a resumed run
TRAINED_TOLERANCE = 0.5  # of errors from run to run: who trains for a time takes as many steps as the machine allows


def target(path: Path | None) -> tuple[mesh_io.Mesh, str]:
    """A mesh, closed and decimated, field frame, and its name; None: the bunny, or a chair where it is absent.

    Raises:
      FileNotFoundError: there is no such file. InputError: it holds no mesh, or none that can be closed.
    """
    file = path or (BUNNY if BUNNY.is_file() else None)
    raw, _ = source_mesh.read(None if file is None else str(file), 0)
    prepared = mesh_preparation.prepare(raw, mesh_config.MeshesConfig(faces=FACES), np.random.default_rng(0))
    within = np.clip(prepared.mesh.vertices, -1.0, 1.0)  # rounding of the frame's scale
    return mesh_io.Mesh(within, prepared.mesh.faces), file.stem if file else "procedural chair"


def recipe(name: str, minutes: float | None, threads: int) -> fit_settings.FitConfig:
    """One of `RECIPES` with a budget of wall time: its own, the longest of ours for the paper's, `minutes` at most."""
    section = _section(name)
    budget = section.minutes or max(_section(own).minutes or 0.0 for own in OURS)
    budget = budget if minutes is None else min(budget, minutes)
    held_out = sample_types.Counts(**dict.fromkeys(paper_ablation.COLUMNS, FINAL_HELD_OUT))
    loop = dataclasses.replace(section.loop, threads=threads, log_every=1 if name == PAPER else LOG_EVERY)
    return dataclasses.replace(section, steps=None, minutes=budget, held_out=held_out, loop=loop)


def _section(name: str) -> fit_settings.FitConfig:
    file = Path("configs") / f"{'long_fit' if name == LIKE else name}.yaml"
    section = config.load(file, "fit", fit_settings.FitConfig)
    if name != LIKE:
        return section
    alike = leave_one_out.settings(section, None, None).samples
    return dataclasses.replace(section, samples=alike, margin=0.0)


class Clock:
    """Evaluates a field while it is trained, and leaves the time of that out; goes on where a stopped run was.

    rows: seconds, step and `fitting.held_out_errors` of every evaluation so far; written to `CURVE` each time.
    """

    def __init__(self, held_out: shape_samples.ShapeSamples, folder: Path) -> None:
        self.held_out, self.folder = held_out, folder
        self.rows: list[dict[str, Any]] = []
        self.zero: float | None = None  # of the clock, once it runs; moved on by evaluations

    def around(self, train: Callable[..., tuple[int, float]]) -> Callable[..., tuple[int, float]]:
        """`training_loop.fit` with evaluations between steps, when one is due, and after the last; none elsewhere."""

        def call(
            model: pddf.PDDF,
            groups: list[dict],
            step_loss: training_loop.StepLoss,
            steps: int | training_loop.Clock,
            loop: training_loop.LoopConfig,
            out_dir: Path,
            *rest: Any,
        ) -> tuple[int, float]:
            if out_dir != self.folder:
                return train(model, groups, step_loss, steps, loop, out_dir, *rest)

            def watched(step: int) -> tuple[Tensor, dict[str, Tensor]]:
                if self.zero is None:
                    self._begin(step)
                due = FACTOR * self.rows[-1]["seconds"] if self.rows else FIRST_SECONDS
                if self.seconds() >= due:
                    self._evaluate(model, step)
                loss, terms = step_loss(step)
                return loss, {**terms, "clock": torch.tensor(self.seconds())}

            done, seconds = train(model, groups, watched, steps, loop, out_dir, *rest)
            if self.zero is None:  # nothing was left to train
                self._begin(done)
            if not self.rows or self.rows[-1]["step"] < done:
                self._evaluate(model, done)
            return done, seconds

        return call

    def seconds(self) -> float:
        """On the clock, 0 before it runs."""
        return 0.0 if self.zero is None else time.monotonic() - self.zero

    def _begin(self, step: int) -> None:
        """At 0, or where the log of a stopped run ends, with the evaluations until then."""
        logged = [row["clock"] for row in training_loop.read_log(self.folder) if row["step"] <= step]
        file = self.folder / CURVE
        if step > 0 and logged and file.exists():
            self.rows = [row for row in storage.read_json(file) if row["step"] <= step]
        self.zero = time.monotonic() - (logged[-1] if step > 0 and logged else 0.0)

    def _evaluate(self, model: pddf.PDDF, step: int) -> None:
        seconds = self.seconds()
        held_out = fitting.held_out_errors(model, self.held_out)
        self.rows.append({"seconds": seconds, "step": step, "held_out": held_out})
        storage.write_json(self.folder / CURVE, self.rows)
        self.zero = time.monotonic() - seconds


def fit(name: str, mesh: mesh_io.Mesh, section: fit_settings.FitConfig) -> None:
    """Fit in one way, or go on with it; `OUT`/<name> then holds what `fitting.fit` writes, and `CURVE`."""
    folder = OUT / name
    folder.mkdir(parents=True, exist_ok=True)
    counts = sample_types.Counts(**dict.fromkeys(paper_ablation.COLUMNS, HELD_OUT))
    held_out, _ = shape_samples.draw_samples(mesh, section, counts, "curve")
    clock = Clock(held_out, folder)
    with mock.patch.object(training_loop, "fit", clock.around(training_loop.fit)):
        fitting.fit(mesh, section, folder)


def errors(held_out: Mapping[str, Any]) -> dict[str, float]:
    """The twelve figures, and the median angle of normals in degrees."""
    found = {
        f"{metric}_{kind}": math.nan if held_out[metric][kind] is None else held_out[metric][kind]
        for metric in paper_ablation.METRICS
        for kind in paper_ablation.COLUMNS
    }
    return {**found, "normal_angle_deg_median": held_out["normal_angle_deg_median"]}


def rows_of(name: str, shape: str, section: fit_settings.FitConfig) -> list[dict[str, Any]]:
    """A row per evaluation, and one more, `<name>, end`, with the errors over `FINAL_HELD_OUT` samples of each type."""
    curve = storage.read_json(OUT / name / CURVE)
    result = storage.read_json(OUT / name / fitting.METRICS)
    size = {"shape": shape, "minutes": section.minutes, "parameters": result["parameters"]}
    rows = []
    for place, point in enumerate(curve, start=1):
        found = errors(point["held_out"])
        row = measuring.row(name, {**size, "evaluation": place}, [point["seconds"]], found, TRAINED_TOLERANCE)
        rows.append({**row, "steps": point["step"], "held_out": HELD_OUT})
    end = measuring.row(f"{name}, end", size, [curve[-1]["seconds"]], errors(result["held_out"]), TRAINED_TOLERANCE)
    return [*rows, {**end, "steps": result["steps"], "held_out": FINAL_HELD_OUT}]


def curve_of(rows: Sequence[Mapping[str, Any]], name: str, error: str) -> list[tuple[float, float]]:
    """(seconds, error) of the rows of one way."""
    return [(row["median_s"], row["error"][error]) for row in rows if row["what"] == name]


def ratios(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """A row for each of ours that was fitted: its time to an A-type depth error, and that of the paper's recipe."""
    found = []
    theirs = curve_of(rows, PAPER, COMPARED)
    for name in OURS:
        ours = curve_of(rows, name, COMPARED)
        if ours and theirs:
            reach = curve_reach.compare(ours, theirs)
            what = f"{name}, to an error that {PAPER} reaches"
            row = measuring.row(what, {}, [reach.our_seconds], {COMPARED: reach.level}, TRAINED_TOLERANCE)
            found.append({**row, **dataclasses.asdict(reach)})
    return found


def draw(rows: Sequence[Mapping[str, Any]], shape: str) -> None:
    """The curves of every way, and the paper's end where the shape is the paper's."""
    panels = []
    for kind in DRAWN:
        curves = {name: curve_of(rows, name, f"depth_l1_x10_{kind}") for name in RECIPES}
        curves = {name: points for name, points in curves.items() if points}
        if shape == BUNNY.stem:
            place = paper_ablation.COLUMNS.index(kind)
            value = paper_ablation.DEPTH_L1_X10[leave_one_out.NONE][place]
            ends = [x for points in curves.values() for x, _ in points]
            curves["the paper's value"] = [(min(ends), value), (max(ends), value)]
        panels.append((f"held-out {kind}", "seconds", curves))
    growth_curves.draw(NAME, panels, "L1 x 10 of depth")


def told(name: str, found: Mapping[str, float]) -> str:
    """The twelve figures as lines, the paper's below ours."""
    lines = []
    for metric, table in paper_ablation.METRICS.items():
        paper: dict[str, float] = dict(zip(paper_ablation.COLUMNS, table[leave_one_out.NONE], strict=True))
        own: dict[str, float] = {kind: found[f"{metric}_{kind}"] for kind in paper_ablation.COLUMNS}
        for source, values in ((name, own), (paper_ablation.SOURCE, paper)):
            lines.append(f"{metric:15} {source:13}" + "".join(f" {kind} {values[kind]:5.2f}" for kind in own))
        reached = sum(own[kind] <= paper[kind] for kind in own)
        lines.append(f"{metric:15} at most the paper's: {reached} of {len(own)}")
    return "\n".join(lines)


def _fit_all(arguments: argparse.Namespace, threads: int) -> None:
    """Each way in a process of its own, one after the other or side by side."""
    given = ["--threads", str(threads)]
    given += ["--mesh", str(arguments.mesh)] if arguments.mesh else []
    given += ["--minutes", str(arguments.minutes)] if arguments.minutes else []
    commands = {name: side_by_side.command(NAME, "--only", name, *given) for name in RECIPES}
    if failed := side_by_side.run(commands, arguments.side_by_side):
        raise checks.InputError(f"not fitted: {', '.join(failed)}")


SECTION = display.Section(elsewhere="../fit_proof/README.md")


def main(given: Sequence[str]) -> None:
    """Fit in every way, write rows and picture; or, with --only, fit in one way and print its figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mesh", type=Path, help="default: the bunny, or a procedural chair where it is absent")
    parser.add_argument("--minutes", type=float, help="of each way, at most (default: those of its config)")
    parser.add_argument("--only", choices=RECIPES, help="one way alone; prints instead of writing")
    side_by_side.add_options(parser, all_at_once=len(RECIPES))
    arguments = parser.parse_args(given)
    threads = side_by_side.threads(arguments, THREADS)
    if arguments.minutes is not None and not arguments.minutes > 0:
        raise checks.InputError(f"--minutes must be > 0; got {arguments.minutes}")
    mesh, shape = target(arguments.mesh)
    if arguments.only:
        section = recipe(arguments.only, arguments.minutes, threads)
        fit(arguments.only, mesh, section)
        (*_, end) = rows_of(arguments.only, shape, section)
        print(f"{shape}, {arguments.only}: {end['steps']:,} steps, {end['median_s']:.0f} s")
        print(told(arguments.only, end["error"]))
        return
    _fit_all(arguments, threads)
    rows: list[dict[str, Any]] = []
    for name in RECIPES:
        rows += rows_of(name, shape, recipe(name, arguments.minutes, threads))
    rows += ratios(rows)
    draw(rows, shape)
    measuring.write(NAME, threads, rows)
