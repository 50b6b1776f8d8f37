"""Fitting one shape: a sphere becomes a sphere in seconds, a resumed fit equals an uninterrupted one."""

import dataclasses
import itertools
import json
import math
import os
import signal

import numpy as np
import pytest
import torch
from _shapes import cube, icosphere, joined, moved, torus
from _support import damage
from _tiny_fits import SPHERE, TINY

from ddf.core import checks, processes, storage
from ddf.data.samples import sample_types
from ddf.fields import field_outputs, framed_field, model_files, pddf, shape_field
from ddf.fit import fitting, shape_samples
from ddf.geometry import mesh_io, primitives, rays
from ddf.models import loop_config
from ddf.training import training_loop
from ddf_lab.evaluation import shape_fits

RADIUS, CENTRE = 3.0, (10.0, -4.0, 2.0)


@pytest.fixture(scope="module")
def sphere(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sphere")
    mesh = moved(icosphere(4), RADIUS, CENTRE)
    result = fitting.fit(mesh, SPHERE, folder)
    return shape_field.load(folder), result


def test_fitted_sphere_has_small_errors_on_every_type(sphere):
    _, result = sphere
    held_out = result["held_out"]
    assert set(held_out["depth_l1"]) == set(held_out["visibility_bce"]) == set("UABSTO")
    assert max(held_out["depth_l1"][kind] for kind in "UAB") < 0.08  # S needs the hand-over exactly at the surface
    assert max(held_out["depth_l1"][kind] for kind in "TO") < 0.15
    assert max(held_out["visibility_bce"][kind] for kind in "UABSO") < 0.35  # T only just touches a sphere
    assert held_out["depth_l1_x10"]["A"] == pytest.approx(10 * held_out["depth_l1"]["A"])
    assert held_out["normal_angle_deg_median"] < 8
    assert result["parameters"] == 6 * 48 + 48 + 2 * (48 * 48 + 48) + 48 * 4 + 4


def test_fitted_sphere_has_the_depth_normals_and_curvatures_of_the_sphere(sphere):
    shape, _ = sphere
    truth = primitives.Sphere(CENTRE, RADIUS)
    random = np.random.default_rng(0)
    start = random.standard_normal((400, 3))
    start *= 4 * RADIUS / np.linalg.norm(start, axis=1, keepdims=True)
    target = 0.6 * RADIUS * (2 * random.random((400, 3)) - 1)
    v = torch.from_numpy((target - start) / np.linalg.norm(target - start, axis=1, keepdims=True))
    points = rays.OrientedPoints(torch.from_numpy(start + np.array(CENTRE)), v)
    hits = primitives.cast(truth, points)
    found, _ = framed_field.query(shape, points, tuple(field_outputs.OUTPUTS))
    seen = hits.visible.numpy() & np.isfinite(found["depth"])
    assert seen.sum() > 0.9 * hits.visible.sum()
    assert np.median(np.abs(found["depth"] - hits.depth.numpy())[seen]) < 0.04 * RADIUS
    cosine = (found["normals"] * hits.normals.numpy()).sum(-1)[seen]
    assert np.median(cosine) > 0.99
    assert np.median(found["mean_curvature"][seen]) == pytest.approx(-2 / RADIUS, rel=0.15)  # as printed, no 1/2
    assert np.median(found["gaussian_curvature"][seen]) == pytest.approx(1 / RADIUS**2, rel=0.3)


@pytest.mark.parametrize(
    ("module", "name", "call", "left"),
    [
        (shape_samples, "draw_samples", 0, [0, 1, 2, 3, 4, 5]),
        (fitting, "step_loss", 3, [4, 5]),
        (fitting, "held_out_errors", 0, []),
    ],
)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_fit_that_a_signal_ends_goes_on_to_the_same_field(tmp_path, monkeypatch, module, name, call, left, number):
    whole, calls, original = fitting.fit(cube(), TINY, tmp_path / "whole"), itertools.count(), getattr(module, name)

    def signalled(*given):
        if next(calls) == call:
            os.kill(os.getpid(), number)
        return original(*given)

    monkeypatch.setattr(module, name, signalled)
    with pytest.raises(processes.Interrupted) as caught, processes.raised():
        fitting.fit(cube(), TINY, tmp_path / "cut")
    assert caught.value.number == number
    assert caught.value.kept == (f"step 4 is kept in {tmp_path / 'cut'}; go on by:" if name == "step_loss" else "")
    begun, step_loss = [], fitting.step_loss
    monkeypatch.setattr(fitting, "step_loss", lambda *a: begun.append(a[-1]) or step_loss(*a))
    resumed = fitting.fit(cube(), TINY, tmp_path / "cut")
    assert begun == left and not resumed["already"]
    assert str(resumed["held_out"]) == str(whole["held_out"])  # NaN, where no T sample of a cube sees it, is not itself
    one, two = (storage.load_tensors(tmp_path / name / model_files.MODEL)[0] for name in ("whole", "cut"))
    assert all(np.array_equal(one[name], two[name]) for name in one)


class _Time:
    """A clock that every step and every draw of samples moves on."""

    def __init__(self, monkeypatch, step_seconds):
        self.now, self.step_seconds = 0.0, step_seconds
        step_loss, draw = fitting.step_loss, shape_samples.draw_samples
        monkeypatch.setattr(fitting, "step_loss", lambda *a: self.moved(self.step_seconds) or step_loss(*a))
        monkeypatch.setattr(shape_samples, "draw_samples", lambda *a: self.moved(0.1 * len(a)) or draw(*a))
        for module in (fitting, training_loop):
            monkeypatch.setattr(module, "time", self)

    def monotonic(self):
        return self.now

    def moved(self, seconds):
        self.now += seconds


def test_minutes_are_a_clock_whatever_a_step_takes(tmp_path, monkeypatch):
    config = dataclasses.replace(TINY, steps=None, minutes=0.5)
    time = _Time(monkeypatch, 1.0)
    rates, rate = [], loop_config.LoopConfig.rate
    monkeypatch.setattr(loop_config.LoopConfig, "rate", lambda *a: rates.append(rate(*a)) or rates[-1])
    quiet = fitting.fit(cube(), config, tmp_path / "quiet")
    assert 28 <= quiet["steps"] <= 30 and quiet["seconds"] == pytest.approx(30, abs=1)
    assert rates[-1] < 0.02 * TINY.loop.learning_rate  # the schedule ends with the time
    begun, steps = time.now, len(rates)
    time.step_seconds = 3.0
    busy = fitting.fit(cube(), config, tmp_path / "busy")
    assert busy["steps"] == len(rates) - steps == pytest.approx(10, abs=1)
    assert time.now - begun == pytest.approx(30, abs=4)
    assert rates[-1] < 0.05 * TINY.loop.learning_rate


def test_a_finished_fit_is_said_at_once_and_more_minutes_go_on(tmp_path, monkeypatch):
    config = dataclasses.replace(TINY, steps=None, minutes=0.5)
    time = _Time(monkeypatch, 1.0)
    first, begun = fitting.fit(cube(), config, tmp_path), time.now
    again = fitting.fit(cube(), config, tmp_path)
    assert time.now == begun and str(again) == str(first | {"already": True})
    fewer = fitting.fit(cube(), dataclasses.replace(config, minutes=0.2), tmp_path)
    more = fitting.fit(cube(), dataclasses.replace(config, minutes=1.0), tmp_path)
    assert fewer["already"] and more["seconds"] == pytest.approx(60, abs=1)
    assert more["steps"] == pytest.approx(60, abs=2) and time.now - begun == pytest.approx(30, abs=5)
    damage(tmp_path / model_files.MODEL)
    assert not fitting.fit(cube(), config, tmp_path)["already"]  # a damaged field is none


def test_flat_meshes_two_fits_in_one_folder_and_the_folder_of_another_model_are_refused(tmp_path):
    line = mesh_io.Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.array([[0, 1, 2]]))
    with pytest.raises(checks.InputError, match="must have a triangle with an area"):
        fitting.fit(line, TINY, tmp_path / "line")
    another = r"another fit \(process \d+\) is at"
    with processes.locked(tmp_path / ".lock", ""), pytest.raises(checks.InputError, match=another):
        fitting.fit(cube(), TINY, tmp_path)
    (tmp_path / model_files.MODEL).write_bytes(b"of a category")
    with pytest.raises(checks.InputError, match="holds a model that no fit wrote"):
        fitting.fit(cube(), TINY, tmp_path)


def test_the_field_of_another_mesh_is_replaced_by_force_alone(tmp_path):
    fitting.fit(cube(), TINY, tmp_path)
    with pytest.raises(checks.InputError, match="holds the field of another mesh; give another folder, or --force"):
        fitting.fit(cube(0.5), TINY, tmp_path)
    fitting.fit(cube(0.5), TINY, tmp_path, force=True)
    fitting.fit(cube(0.5), dataclasses.replace(TINY, steps=3), tmp_path)  # other settings of the same mesh are welcome


def _tensors(samples, kind):
    return {name: torch.from_numpy(values) for name, values in samples.arrays[kind].items()}


@pytest.mark.parametrize("margin", [0.0, 0.02, 0.1])
def test_samples_stay_in_the_tight_box_and_thin_meshes_get_the_cube(margin):
    slab, config = moved(cube(), np.array([1.0, 0.4, 0.7]), (0.0, 0.0, 0.0)), dataclasses.replace(TINY, margin=margin)
    samples = shape_samples.draw_samples(slab, config.drawing, TINY.samples, "train")
    sides = (1 - margin) * np.array([1.0, 0.4, 0.7]) + margin
    np.testing.assert_allclose(samples.upper, sides, atol=1e-6)
    np.testing.assert_allclose(samples.lower, -sides, atol=1e-6)
    batch = samples.batch({**TINY.batch, "E": 500}, np.random.default_rng(0))
    assert bool((batch.positions.abs() <= torch.from_numpy(sides) + 1e-4).all())
    assert batch.positions.shape == (1, 620, 3)
    extra = batch.positions[0, :500].abs().amax(0)
    assert bool((extra > 0.9 * torch.from_numpy(sides)).all())
    plate = moved(slab, np.array([1.0, 0.01, 1.0]), (0.0, 0.0, 0.0))
    thin = shape_samples.draw_samples(plate, config.drawing, TINY.samples, "x")
    assert thin.upper.tolist() == [1.0, 1.0, 1.0]


def test_errors_are_those_of_a_shape_of_length_two_whatever_the_margin():
    field, found = pddf.PDDF(TINY.field), {}
    with torch.no_grad():
        field.network.head.weight.zero_()
    for margin in (0.0, 0.5):
        with torch.no_grad():
            field.network.head.bias[:2] = (1 - margin) * 0.5  # the same surface, seen in both frames
        config = dataclasses.replace(TINY, margin=margin)
        samples = shape_samples.draw_samples(cube(), config.drawing, sample_types.each(2000), "held_out")
        found[margin] = fitting.held_out_errors(field, samples)["depth_l1"]["S"]
    assert found[0.5] == pytest.approx(found[0.0], rel=0.05)  # S starts on the shape alone


def test_errors_over_rays_that_all_miss_are_not_a_number_and_never_0():
    samples = shape_samples.draw_samples(cube(), TINY.drawing, sample_types.each(50), "held_out")
    for part in samples.arrays.values():
        part["visible"][:] = 0
    found = fitting.held_out_errors(pddf.PDDF(TINY.field), samples)
    means = [found["depth_l1"]["U"], found["depth_l1_x10"]["T"], found["normal_angle_deg_median"]]
    assert all(map(math.isnan, [*means, *found["normal_angle_deg"]["A"].values()]))
    assert found["visibility_bce"]["U"] > 0  # of all samples, seen or not
    table = shape_fits.fit_table(json.loads(json.dumps(found).replace("NaN", "null")))  # as fit.json has it
    assert table[(table["source"] == "measured") & (table["metric"] == "depth_l1_x10")]["value"].isna().all()


def test_inner_sheets_are_part_of_the_shape():
    nested = joined(cube(), cube(0.3))
    samples = shape_samples.draw_samples(nested, TINY.drawing, sample_types.each(2000), "train")
    half = 0.3 * (1 - TINY.margin)
    u = _tensors(samples, "U")
    directions = torch.nn.functional.normalize(u["directions"].double(), dim=-1)
    points = rays.OrientedPoints(u["positions"].double(), directions)
    hits = primitives.cast(primitives.Box((-half, -half, -half), (half, half, half)), points)
    inner = hits.visible & (u["positions"].abs().amax(-1) < 1 - TINY.margin)  # others see the outer cube first
    assert bool(inner.any())
    torch.testing.assert_close(u["depth"][inner].double(), hits.depth[inner], rtol=0, atol=1e-3)


def test_file_holds_what_made_it(tmp_path):
    fitting.fit(moved(cube(), 7.0, (1.0, 2.0, 3.0)), TINY, tmp_path, {"cube.obj": "abc"})
    record = storage.load_metadata(tmp_path / model_files.MODEL)
    assert (record["sources"], record["seed"]) == ({"cube.obj": "abc"}, 0) and "torch" in record["packages"]
    shape = shape_field.load(tmp_path)
    np.testing.assert_allclose(shape.field_from_mesh.apply(np.array([[8.0, 9.0, 10.0]])), 1 - TINY.margin)
    again = tmp_path / "again"
    fitting.fit(moved(cube(), 7.0, (1.0, 2.0, 3.0)), TINY, again, {"cube.obj": "abc"})
    assert (again / model_files.MODEL).read_bytes() == (tmp_path / model_files.MODEL).read_bytes()


def test_a_left_out_type_gives_its_share_of_a_step_to_the_others_and_takes_its_points_of_values_along():
    samples = shape_samples.draw_samples(cube(), TINY.drawing, TINY.samples, "train")
    counts = {"U": 400, "A": 400, "B": 200, "S": 100, "T": 200, "O": 150, "E": 50}
    assert samples.batch_counts(counts) == counts
    fewer = samples.without("S").batch_counts(counts)
    assert "S" not in fewer and fewer["E"] == 50 and fewer["U"] == round(400 * 1450 / 1350)
    assert abs(sum(fewer.values()) - sum(counts.values())) <= 3
    batch = samples.without("S").batch(fewer, np.random.default_rng(0))
    assert batch.positions.shape == (1, sum(fewer.values()), 3)
    assert batch.span("S", "S").start == batch.span("S", "S").stop
    more = {**dict.fromkeys(sample_types.ORDER, 10), "S+": 300, "U+": 20}
    batch = samples.batch(samples.batch_counts(more), np.random.default_rng(0))
    assert batch.positions.shape == (1, 390, 3) and batch.span("S+", "S+") == slice(90, 390)
    stored = {tuple(row) for row in samples.arrays["S"]["positions"].tolist()}
    assert all(tuple(row) in stored for row in batch.positions[0, 90:].tolist())
    fewer = samples.without("S").batch_counts(more)
    assert not {"S", "S+"} & set(fewer) and abs(sum(fewer.values()) - 390) <= 4


@pytest.mark.parametrize(("start", "kept"), [("flat", True), ("random", False)])
def test_a_flat_start_keeps_depth_above_zero_where_a_random_one_loses_its_gradient(tmp_path, start, kept):
    config = dataclasses.replace(
        TINY,
        start=start,
        field=pddf.PDDFConfig((64, 64, 64), 6.0, 1.0, "softplus", 100.0),
        steps=80,
        samples=sample_types.each(2000),
        batch={"U": 100, "A": 100, "B": 50, "S": 25, "T": 50, "O": 40, "E": 10},
        loop=loop_config.LoopConfig(1e-2, "cosine", 20, 1.0, 1, 0, 50, 100.0),
    )
    fitting.fit(torus(0.7, 0.3), config, tmp_path)
    counts = sample_types.each(config.held_out)
    tested = _tensors(shape_samples.draw_samples(torus(0.7, 0.3), config.drawing, counts, "held_out"), "U")
    seen = {name: values[tested["visible"] > 0] for name, values in tested.items()}
    raw = shape_field.load(tmp_path).field(seen["positions"], seen["directions"])[:, : pddf.NUM_COMPONENTS]
    dead = float((raw < -0.05).float().mean())  # 5 over the sharpness: a slope of 0.7 %
    assert dead < 0.1 if kept else dead > 0.5
