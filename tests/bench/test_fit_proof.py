"""What `make fit-proof` measures with: clocks, ratios, closed forms, the contact sheet, its page."""

import argparse
import dataclasses
import os
import types
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from _shapes import cube
from _tiny_fits import TINY

from bench.fits import contact_sheet, fit_curves, fit_options, fit_page, primitive_fits
from bench.lib import curve_reach, measuring, overrides, results, side_by_side
from ddf.core import checks, config, storage
from ddf.fit import fit_settings, fitting, shape_samples
from ddf.geometry import mesh_io, primitives, rays
from ddf.training import training_loop
from ddf_lab.evaluation.shape import paper_ablation
from ddf_lab.report import pages

ROOT = Path(__file__).resolve().parents[2]
NO_SAMPLES = shape_samples.ShapeSamples({}, np.zeros(3), np.ones(3))


def test_ratio_is_that_of_the_times_at_an_error_both_reach():
    ours, theirs = [(1.0, 0.9), (2.0, 0.5), (4.0, 0.2)], [(3.0, 0.8), (40.0, 0.5), (60.0, 0.55)]
    found = curve_reach.compare(ours, theirs)
    assert (found.level, found.our_seconds, found.their_seconds, found.times) == (0.5, 2.0, 40.0, 20.0)
    assert (found.goal, found.goal_seconds, found.their_goal_seconds, found.bound) == (0.2, 4.0, 60.0, True)
    back = curve_reach.compare(theirs, ours)
    assert (back.level, back.times, back.their_goal_seconds, back.bound) == (0.5, 2 / 40, 2.0, False)
    with pytest.raises(ValueError, match="need a point"):
        curve_reach.compare([], theirs)


class _Clocked:
    """A clock that steps and evaluations move on, instead of the machine's."""

    def __init__(self, monkeypatch, evaluation):
        self.now = 0.0
        monkeypatch.setattr(fit_curves, "time", types.SimpleNamespace(monotonic=lambda: self.now))
        monkeypatch.setattr(fitting, "held_out_errors", lambda *_: self.passes(evaluation) or {"off": self.now})

    def passes(self, seconds):
        self.now += seconds

    def train(self, start):
        def run(model, groups, step_loss, steps, *rest):
            for step in range(start, steps):
                self.passes(10.0)
                _, terms = step_loss(step)
                assert 0 <= float(terms["clock"]) <= self.now
            return steps, self.now

        return run

    def loss(self, step):
        return torch.zeros(()), {"depth": torch.zeros(())}


def test_curve_has_growing_times_and_leaves_evaluations_out(tmp_path, monkeypatch):
    clocked = _Clocked(monkeypatch, evaluation=1000.0)
    clock = fit_curves.Clock(NO_SAMPLES, tmp_path)
    clock.around(clocked.train(0))(None, [], clocked.loss, 10, None, tmp_path)
    rows = storage.read_json(tmp_path / fit_curves.CURVE)
    assert [row["seconds"] for row in rows] == [10.0, 20.0, 30.0, 50.0, 80.0, 90.0]
    assert [row["step"] for row in rows] == [1, 2, 3, 5, 8, 10]
    assert clocked.now == 100.0 + 1000.0 * len(rows)


def test_trials_in_other_folders_are_not_on_the_clock(tmp_path, monkeypatch):
    clocked = _Clocked(monkeypatch, evaluation=1000.0)
    clock = fit_curves.Clock(NO_SAMPLES, tmp_path)
    seen = []
    clock.around(lambda *given: (seen.append(given), (10, 1.0))[1])(
        None, [], clocked.loss, 10, None, tmp_path / "trial"
    )
    assert seen == [(None, [], clocked.loss, 10, None, tmp_path / "trial")]
    assert clock.seconds() == 0
    assert clock.rows == []


def test_resumed_curve_goes_on_from_the_logged_time(tmp_path, monkeypatch):
    clocked = _Clocked(monkeypatch, evaluation=0.0)
    old = [{"seconds": s, "step": k, "held_out": {}} for s, k in ((10.0, 1), (30.0, 3), (70.0, 7))]
    storage.write_json(tmp_path / fit_curves.CURVE, old)
    logged = [{"step": float(k), "clock": 10.0 * k} for k in range(1, 8)]
    monkeypatch.setattr(training_loop, "read_log", lambda folder: logged)
    clocked.passes(500.0)  # sampling once more is not counted
    clock = fit_curves.Clock(NO_SAMPLES, tmp_path)
    clock.around(clocked.train(5))(None, [], clocked.loss, 8, None, tmp_path)
    assert [(row["seconds"], row["step"]) for row in clock.rows] == [(10.0, 1), (30.0, 3), (50.0, 5), (70.0, 8)]


def test_watched_fit_is_the_fit_itself_and_a_second_call_keeps_its_curve(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(fit_curves, "HELD_OUT", 50)
    monkeypatch.setattr(fit_curves, "FIRST_SECONDS", 0.0)
    section = dataclasses.replace(TINY, loop=dataclasses.replace(TINY.loop, log_every=1))
    fit_curves.fit("fit", cube(), section)
    plain = fitting.fit(cube(), section, tmp_path / "plain")
    folder = fit_curves.OUT / "fit"
    assert storage.read_json(folder / fitting.METRICS)["held_out"] == storage._null_for_nan(plain["held_out"])
    curve = storage.read_json(folder / fit_curves.CURVE)
    assert curve[-1]["step"] == section.steps and len(curve) > 1
    assert "clock" in training_loop.read_log(folder)[0]
    fit_curves.fit("fit", cube(), section)
    assert storage.read_json(folder / fit_curves.CURVE) == curve
    rows = fit_curves.rows_of("fit", "cube", section)
    assert [row["what"] for row in rows] == ["fit"] * len(curve) + ["fit, end"]
    assert rows[-1]["error"]["depth_l1_x10_A"] == pytest.approx(10 * plain["held_out"]["depth_l1"]["A"])
    assert "at most the paper's" in fit_curves.told("fit", rows[-1]["error"])


def test_all_ways_end_in_rows_ratios_and_a_picture_that_the_page_can_tell(tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)  # where the configs are
    monkeypatch.setattr(fit_curves, "OUT", tmp_path)
    monkeypatch.setattr(measuring, "OUT", tmp_path / "bench")
    monkeypatch.setattr(fit_curves, "target", lambda path: (cube(), "bunny_60k"))
    held_out = {
        "normal_angle_deg_median": 5.0,
        **{metric: dict.fromkeys("UABOTS", 0.5) for metric in paper_ablation.METRICS},
    }
    told = {"held_out": held_out, "parameters": 100, "steps": 30}

    def curve(slower):
        worse = [{**held_out, "depth_l1_x10": dict.fromkeys("UABOTS", error)} for error in (3.0, 1.0, 0.5)]
        return [{"seconds": slower * 2.0**k, "step": 10 * k, "held_out": one} for k, one in enumerate(worse)]

    def run(commands, at_once):
        for name in commands:
            (tmp_path / name).mkdir()
            storage.write_json(tmp_path / name / fit_curves.CURVE, curve(8.0 if name == fit_curves.PAPER else 1.0))
            storage.write_json(tmp_path / name / fitting.METRICS, told)
        return []

    monkeypatch.setattr(side_by_side, "run", run)
    fit_curves.main(["--side-by-side", "--threads", "1"])
    benchmark = results.load(tmp_path / "bench" / f"{fit_curves.NAME}.json")
    ratios = [row for row in benchmark.rows if "times" in row.told]
    assert [row.told["times"] for row in ratios] == [8.0] * len(fit_curves.OURS)
    assert ratios[0].seconds == (4.0, 4.0, 4.0) and ratios[0].error == {fit_curves.COMPARED: 0.5}
    assert (tmp_path / "bench" / f"{fit_curves.NAME}.png").exists()
    page = pages.markdown(fit_page.build({fit_curves.NAME: benchmark}, None))
    assert "8 times as long" in page and "`like_for_like` has the data of the row." in page
    old = dataclasses.replace(benchmark, rows=[row for row in benchmark.rows if fit_curves.LIKE not in row.what])
    assert "no way has its data." in pages.markdown(fit_page.build({fit_curves.NAME: old}, None))
    monkeypatch.setattr(side_by_side, "run", lambda commands, at_once: ["fit"])
    with pytest.raises(checks.InputError, match="not fitted: fit"):
        fit_curves.main([])


def test_budgets_are_the_configs_own_and_the_paper_gets_the_longest():
    minutes = {name: fit_curves.recipe(name, None, 1).minutes or 0.0 for name in fit_curves.RECIPES}
    assert minutes[fit_curves.PAPER] == max(minutes[name] for name in fit_curves.OURS) > minutes["fit"]
    assert {fit_curves.recipe(name, 0.5, 1).minutes for name in fit_curves.RECIPES} == {0.5}


def test_like_for_like_has_the_data_of_the_paper_s_row_and_the_rest_of_long_fit():
    like, long = (fit_curves.recipe(name, None, 1) for name in (fit_curves.LIKE, "long_fit"))
    assert set(dict(like.samples.items()).values()) == {83_333}
    assert like.margin == 0.0
    assert dataclasses.replace(like, samples=long.samples, margin=long.margin) == long


def test_rays_look_at_the_shape_and_start_outside_its_box():
    mesh = cube(0.5)
    points = primitive_fits.looking_at(mesh, 500, seed=0)
    assert float(points.positions.norm(dim=-1).min()) > mesh.diagonal()
    hits = primitives.cast(primitives.Box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)), points)
    assert hits.visible.all()  # they aim at points inside


def test_edge_distance_of_points_on_a_box():
    box = primitives.Box((-1.0, -0.7, -0.5), (1.0, 0.7, 0.5))
    points = torch.tensor([[1.0, 0.0, 0.0], [1.0, 0.7, 0.0], [0.2, -0.7, 0.45], [-0.95, 0.1, -0.5]])
    torch.testing.assert_close(primitive_fits.edge_distance(box, points), torch.tensor([0.5, 0.0, 0.05, 0.05]))


def test_curvature_errors_are_relative_to_the_scale_of_curvature():
    kappa = torch.tensor([[-2.0, -2.0], [-2.0, 1.0], [9.0, 9.0]])
    found = {"mean_curvature": torch.tensor([-4.4, -1.3, 0.0]), "gaussian_curvature": torch.tensor([4.4, -1.6, 0.0])}
    kept = torch.tensor([True, True, False])
    result = primitive_fits.curvature_errors(found, kappa, kept)
    assert result == {name: pytest.approx(0.1, abs=1e-6) for name in result if "mean_c" in name or "error" in name}
    assert set(result) == {
        f"{n}_curvature_{k}" for n in ("mean", "gaussian") for k in ("median_error", "error_of_median")
    }


def test_meshes_of_the_primitives_lie_on_their_closed_forms():
    for case in primitive_fits.cases().values():
        points = primitive_fits.looking_at(case.mesh, 2000, seed=2)
        own = case.own(points)
        hits = primitives.cast(case.truth, own)
        q = rays.surface_points(own.positions, own.directions, hits.depth)[hits.visible]
        vertices = case.mesh.vertices @ case.turn.numpy()
        lower, upper = vertices.min(axis=0), vertices.max(axis=0)
        np.testing.assert_allclose(q.min(dim=0).values.numpy(), lower, atol=0.1)
        np.testing.assert_allclose(q.max(dim=0).values.numpy(), upper, atol=0.1)


def test_contact_sheet_leaves_hard_meshes_out_and_refuses_an_empty_folder(tmp_path):
    for name in ("b.ply", "a.obj", "hard_c.ply", "bad_d.obj", "notes.md"):
        (tmp_path / name).touch()
    assert [file.name for file in contact_sheet.everyday(tmp_path)] == ["a.obj", "b.ply"]
    with pytest.raises(checks.InputError, match="no everyday mesh"):
        contact_sheet.everyday(tmp_path / "none")


def test_contact_sheet_fits_each_mesh_once_and_draws_it(tmp_path, monkeypatch):
    monkeypatch.setattr(contact_sheet, "FIELDS", tmp_path / "fields")
    file = tmp_path / "cube.ply"
    file.write_bytes(mesh_io.ply_bytes(cube()))
    item = contact_sheet.fitted(file, TINY)
    row = contact_sheet.pictures(item, 16)
    assert len(row.cells) == len(contact_sheet.COLUMNS) and all(cell is not None for cell in row.cells)
    assert contact_sheet.row_of(item)["steps"] == TINY.steps

    def refuse(*_):
        raise AssertionError("fitted again")

    monkeypatch.setattr(fitting, "fit", refuse)
    assert contact_sheet.fitted(file, TINY).folder == item.folder
    with pytest.raises(AssertionError, match="fitted again"):
        contact_sheet.fitted(file, dataclasses.replace(TINY, steps=7))


def test_fits_side_by_side_share_the_cores_unless_told(monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 5)
    parser = argparse.ArgumentParser()
    side_by_side.add_options(parser, all_at_once=3)
    cases = {"": 4, "--side-by-side 2": 2, "--side-by-side": 1, "--side-by-side 9": 1, "--side-by-side --threads 7": 7}
    for given, expected in cases.items():
        assert side_by_side.threads(parser.parse_args(given.split()), own=4) == expected
    for wrong in ("--side-by-side 0", "--threads -1"):
        with pytest.raises(checks.InputError, match="must be >= 1"):
            side_by_side.threads(parser.parse_args(wrong.split()), own=4)


def test_side_by_side_names_those_that_failed(tmp_path):
    waits = "import pathlib, sys, time\nwhile not pathlib.Path(sys.argv[1]).exists(): time.sleep(0.01)"
    makes = "import pathlib, sys\npathlib.Path(sys.argv[1]).touch()"
    commands = {"first": ["-c", "exit(3)"], "waits": ["-c", waits, str(tmp_path / "made")]}
    commands |= {"makes": ["-c", makes, str(tmp_path / "made")], "last": ["-c", "exit(1)"]}
    assert side_by_side.run(commands, at_once=2) == ["first", "last"]  # one after the other it would wait for ever


def _called_in_place(monkeypatch, script, section):
    """Instead of processes, and with another config: what the processes are told is done by the script's main here."""
    calls = []

    def run(commands, at_once):
        calls.append((at_once, len(commands)))
        failed = []
        for name, (_, _, _, *arguments) in commands.items():
            try:
                script.main(arguments)
            except checks.InputError:
                failed.append(name)
        return failed

    monkeypatch.setattr(side_by_side, "run", run)
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    monkeypatch.setattr(config, "load", lambda *_: section)
    return calls


BRIEF = dataclasses.replace(TINY, minutes=0.001, page=fit_settings.PageConfig(8, "y", 1))


def test_contact_sheet_fits_side_by_side_and_leaves_out_what_fails(tmp_path, monkeypatch, capsys):
    calls = _called_in_place(monkeypatch, contact_sheet, BRIEF)
    monkeypatch.setattr(contact_sheet, "FIELDS", tmp_path / "fields")
    for name in ("a", "b"):
        (tmp_path / f"{name}.ply").write_bytes(mesh_io.ply_bytes(cube()))
    (tmp_path / "broken.ply").write_text("no mesh")
    contact_sheet.main([str(tmp_path), "--out", str(tmp_path / "out"), "--side-by-side", "2"])
    table = pd.read_csv(tmp_path / "out" / contact_sheet.TABLE)
    assert table["mesh"].tolist() == ["a.ply", "b.ply"] and table["threads"].tolist() == [1, 1]
    assert calls == [(2, 3)] and "broken.ply: left out" in capsys.readouterr().err
    assert (tmp_path / "out" / contact_sheet.SHEET).exists()


def test_primitives_are_measured_side_by_side(monkeypatch, capsys):
    calls = _called_in_place(monkeypatch, primitive_fits, BRIEF)
    monkeypatch.setattr(primitive_fits, "RAYS", 200)
    monkeypatch.setattr(primitive_fits, "errors", lambda *_: {"depth_median": 0.5})
    written = []
    monkeypatch.setattr(measuring, "write", lambda *given: written.append(given))
    primitive_fits.main(["--side-by-side", "4"])
    (name, threads, rows), known = written[0], list(primitive_fits.cases())
    assert (name, threads, calls) == (primitive_fits.NAME, 1, [(4, len(known))])
    assert [row["what"] for row in rows] == known and rows[0]["error"] == {"depth_median": 0.5}
    assert capsys.readouterr().out.count("depth_median") == len(known)


@pytest.mark.parametrize("name", fit_options.OPTIONS)
def test_every_option_of_a_fit_is_another_fit(name):
    base, other = (fit_options.section_of(each, 0.1, 2) for each in (fit_options.BASE, name))
    assert (base == other) == (name == fit_options.BASE)
    assert (other.minutes, other.steps, other.loop.threads) == (0.1, None, 2)


def test_widths_and_batches_of_the_options_are_changes_of_the_config():
    base = fit_options.section_of(fit_options.BASE, 0.1, 1)
    assert base.field.hidden == (fit_options.WIDTH,) * fit_options.LAYERS and base.batch == fit_options.BATCH


def test_changes_leave_the_settings_alone_and_are_changes():
    settings = {"a": {"b": 1, "c": 2}}
    assert overrides.changed(settings, {"a.b": 3, "a.c": overrides.ABSENT}, "x") == {"a": {"b": 3}}
    assert settings == {"a": {"b": 1, "c": 2}}
    with pytest.raises(checks.InputError, match=r"x: a\.b is 1 already"):
        overrides.changed(settings, {"a.b": 1}, "x")


def test_options_are_fitted_side_by_side_and_shown_against_the_base(tmp_path, monkeypatch):
    calls = _called_in_place(monkeypatch, fit_options, BRIEF)
    monkeypatch.setattr(fit_options, "section_of", lambda *_: BRIEF)
    monkeypatch.setattr(fit_options, "OPTIONS", {"base": {}, "other": {}})
    monkeypatch.setattr(fit_curves, "target", lambda _: (cube(), "cube"))
    monkeypatch.setattr(measuring, "OUT", tmp_path)
    fit_options.main(["--side-by-side", "2"])
    assert calls == [(2, 2)]
    text = pages.markdown(fit_page.build({"fit_options": results.load(tmp_path / "fit_options.json")}, None))
    lines = [line for line in text.splitlines() if line.startswith(("| base", "| other"))]
    assert [line.split(" | ")[0] for line in lines] == ["| base", "| other"] * 3  # depth, visibility, normals
    assert [base.count("**") for base in lines[::2]] == [2 * 5, 2 * 6, 2 * 1]  # no cast T sample sees the cube
    assert lines[4].replace("base", "other").split("|")[2] == lines[5].split("|")[2]  # steps and seconds


def _curve_rows():
    figures = {f"{metric}_{kind}": 0.3 for metric in paper_ablation.METRICS for kind in "UABOTS"}
    size = {"shape": "bunny_60k"}
    told = {"steps": 1234, "held_out": 25_000}
    reach = dataclasses.asdict(curve_reach.compare([(2.0, 0.5), (4.0, 0.2)], [(40.0, 0.5)]))
    return [
        results.Row("fit, end", size, (4.0, 4.0, 4.0), figures, told),
        results.Row("fit, to an error that paper_fit reaches", {}, (2.0, 2.0, 2.0), {}, reach),
    ]


def test_page_marks_what_reaches_the_paper_and_states_bounds_as_bounds():
    versions = {"torch": "2"}
    found = {"fit_curves": results.Benchmark("fit_curves", "a CPU", 2, 2, versions, _curve_rows())}
    text = pages.markdown(fit_page.build(found, None))
    _, ours = (line for line in text.splitlines() if line.startswith("| fit | 4 s, 1,234 steps |"))
    assert ours.count("**0.30**") == 1  # O alone: the paper has .56 there, and less than .30 elsewhere
    below = sum(bound >= 0.3 for bounds in paper_ablation.METRICS.values() for bound in bounds["none"])
    assert f"reaches: `fit` {below} (4 s). " in text.split("\n\n")[1] and 0 < below < 12
    assert text.split("\n\n")[2].startswith("![falling curves")
    assert "20 times as long" in text and "In all its 40 s it does not come down to the 0.2" in text
    with pytest.raises(checks.InputError, match="nothing to tell"):
        fit_page.build({}, None)


def test_page_shows_the_sheet_with_its_medians():
    columns = {f"{metric}_{kind}": [0.1, 0.5, 0.3] for metric in paper_ablation.METRICS for kind in "UABOTS"}
    text = pages.markdown(fit_page.build({}, pd.DataFrame({**columns, "seconds": [120.0] * 3, "threads": 1})))
    assert text.count("| 0.30 |") and contact_sheet.SHEET in text and "3 meshes, 120 s and 1 thread each" in text
