"""Patches from mesh to file and back: what the folder holds, old kinds beside it, refusals in one line."""

import json

import numpy as np
import pytest
from _shapes import cube, icosphere
from _sphere_scan import RADIUS, sphere_scan

import ddf
from ddf import cli
from ddf.core import checks, storage
from ddf.fields import shape_field, stored_fields
from ddf.fields.grid import octree, patch_field
from ddf.fit import patch_fitting
from ddf.geometry import mesh_io, scans


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("patches") / "cube"
    return folder, patch_fitting.fit(cube(2.0), octree.PatchConfig(), folder, {"cube.ply": "0"})


def test_held_out_errors_are_those_of_an_exact_field(fitted):
    _, result = fitted
    held_out = result["held_out"]
    assert set(held_out["depth_l1"]) == set("UABSTO") == set(held_out["visibility_bce"])
    assert max(held_out["depth_l1"][kind] for kind in "UABO") < 1e-3
    assert held_out["normal_angle_deg_median"] < 0.5 and held_out["visibility_bce"]["U"] < 0.02
    assert result["bytes"] < 45_000 and result["steps"] == 0 and result["patches"] > 1000


def test_a_file_answers_as_what_was_written(fitted):
    folder, result = fitted
    assert {path.name for path in folder.iterdir()} >= {"model.safetensors", "fit.json", "plan.json"}
    assert json.loads((folder / "fit.json").read_text())["patches"] == result["patches"]
    assert (folder / "model.safetensors").stat().st_size < result["bytes"] + 4000
    shape = stored_fields.load(folder)
    assert isinstance(shape, patch_field.PatchField) and shape.record["sources"] == {"cube.ply": "0"}
    field = ddf.load(folder)
    assert field.outputs == patch_field.OUTPUTS
    seen = field.query([[0.0, 0.0, 9.0]], [[0.0, 0.0, -1.0]], outputs=field.outputs)
    assert seen["depth"] == pytest.approx(7, abs=1e-4) and np.allclose(seen["normals"], [[0, 0, 1]], atol=1e-4)
    assert np.isfinite(field.render(size=16)["depth"]).any()
    assert np.abs(np.abs(field.points(300)).max(axis=1) - 2).max() < 1e-3
    distances, ways = field.udf([[0.0, 5.0, 0.0]])
    assert distances[0] == pytest.approx(3, abs=0.02) and ways[0, 1] < -0.99
    assert np.abs(np.abs(field.surface(method="udf", resolution=16).vertices).max(axis=1) - 2).max() < 0.2
    beside = np.eye(4)
    beside[0, 3] = 5.0
    pair = ddf.compose([field, field], [np.eye(4), beside]).query([[5.0, 0, 9]], [[0, 0, -1.0]])
    assert pair["depth"] == pytest.approx(7, abs=1e-4)


def test_the_same_mesh_gives_the_same_bytes(fitted, tmp_path):
    patch_fitting.fit(cube(2.0), octree.PatchConfig(), tmp_path, {"cube.ply": "0"})
    assert (tmp_path / "model.safetensors").read_bytes() == (fitted[0] / "model.safetensors").read_bytes()


def test_another_mesh_in_the_folder_is_kept_unless_forced(fitted, tmp_path):
    patch_fitting.fit(icosphere(2), octree.PatchConfig(), tmp_path)
    with pytest.raises(checks.InputError, match="holds the field of another mesh"):
        patch_fitting.fit(cube(), octree.PatchConfig(), tmp_path)
    patch_fitting.fit(cube(), octree.PatchConfig(), tmp_path, force=True)
    assert ddf.load(tmp_path).query([[0.0, 0.0, 3.0]], [[0, 0, -1.0]])["depth"] == pytest.approx(2, abs=1e-4)


def _deep(levels: int) -> dict[str, np.ndarray]:
    """Arrays of one patch in a first cell that is cut so often."""
    states = np.zeros(octree.BASE**3 + 8 * levels, int)
    states[[0, *(octree.BASE**3 + 8 * np.arange(levels))]] = [octree.CUT] * levels + [octree.LEAF]
    return octree.pack(states, np.eye(1, 7), np.array([1]), np.array([2 / octree.BASE / 2**levels]))


def test_damage_is_named_and_what_needs_a_network_refuses_patches(fitted, tmp_path):
    with pytest.raises(checks.InputError, match="holds patches, this needs a network's weights"):
        shape_field.load(fitted[0])
    arrays, record = storage.load_tensors(fitted[0] / "model.safetensors")
    file, codes = tmp_path / "model.safetensors", arrays["codes"].copy()
    alone = np.flatnonzero((codes[:-1] & codes[1:] & 1) == 1)[0] + 1
    codes[alone] |= 1 << 4  # cut by a second patch, which its leaf does not have
    parts = {"planes": arrays["planes"][:, :2]}, {"bends": np.zeros((1, 3), np.int16)}, {"cells": arrays["cells"][:-2]}
    for changed in ({"codes": arrays["codes"][1:]}, {"codes": codes}, _deep(11), *parts):
        storage.save_tensors(file, arrays | changed, record)
        with pytest.raises(checks.InputError, match=r"model\.safetensors: .*cells and patches do not fit together"):
            stored_fields.load(file)
    storage.save_tensors(file, _deep(10), record)
    assert len(patch_field.load(file).tree.codes) == 1
    wide = {"lower": [-1, -1, -1], "upper": [1, 1, 1 + 1e-6]}
    for odd in ({"box": {}}, {"box": wide}, {"tolerance": 0}, {"tolerance": [1]}, {"field_from_mesh": {"scale": 1}}):
        storage.save_tensors(file, arrays, {**record, **odd})
        with pytest.raises(checks.InputError, match=r"model\.safetensors: its record lacks what a field needs"):
            stored_fields.load(file)


def test_the_command_fits_patches_unless_training_is_asked_for(tmp_path, capsys):
    mesh = tmp_path / "ball.ply"
    mesh.write_bytes(mesh_io.ply_bytes(icosphere(3)))
    assert cli.main(["fit", "--json", str(mesh), str(tmp_path / "out"), "--tolerance", "1e-3"]) == 0
    assert json.loads(capsys.readouterr().out)["patches"] > 100
    with pytest.raises(ValueError, match="patches take neither minutes nor steps"):
        ddf.fit(mesh, steps=2, kind="patches")
    assert ddf.fit(mesh).outputs == patch_field.OUTPUTS


@pytest.fixture(scope="module")
def of_rays(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rays")
    scans.write(sphere_scan(24, 0.01), folder / "scan.npz")
    assert cli.main(["fit", str(folder / "scan.npz"), str(folder / "field")]) == 0
    return folder, json.loads((folder / "field/fit.json").read_text())


def test_rays_become_patches_within_their_noise(of_rays):
    folder, result = of_rays
    field, random = ddf.load(folder / "field"), np.random.default_rng(0)
    ways = random.standard_normal((5000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    starts = -1.5 * ways + random.uniform(-0.2, 0.2, (5000, 3))
    across = np.linalg.norm(starts - (starts * ways).sum(axis=1, keepdims=True) * ways, axis=1)
    truth = -(starts * ways).sum(axis=1) - np.sqrt(RADIUS**2 - across**2)
    depth = field.query(starts, ways)["depth"]
    assert np.isfinite(depth).all() and np.median(np.abs(depth - truth)) < 0.004 and np.abs(depth - truth).max() < 0.02
    held_out = result["held_out"]
    assert held_out["wrong"] < 0.02 and 0.004 < held_out["depth_median"] < 0.01 < 10 * result["noise"]


def test_what_no_ray_saw_is_told(of_rays):
    field = ddf.load(of_rays[0] / "field")
    ahead = np.array([[0.0, 0, 1]])
    assert field.seen([[0.0, 0, -1]], ahead).tolist() == [True]
    assert field.seen([[0.0, 0, 0]], ahead).tolist() == [False]
    asked, out = (str(of_rays[0] / name) for name in ("asked.npz", "answers.npz"))
    np.savez(asked, positions=[[0.0, 0, -1], [0, 0, 0]], directions=np.repeat(ahead, 2, axis=0))
    assert cli.main(["query", str(of_rays[0] / "field"), "--rays", asked, "--out", out, "--seen"]) == 0
    assert np.load(out)["seen"].tolist() == [True, False]
    with pytest.raises(ValueError, match="not fitted to rays"):
        ddf.load("rabbit").seen([[0.0, 0, -1]], ahead)


def test_one_view_knows_half(tmp_path):
    scan = sphere_scan(24)
    first = scan.positions[:, 0] == scan.positions[0, 0]
    view = scans.Scan(scan.positions[first], scan.directions[first], scan.ranges[first])
    field, eye = ddf.fit(rays=view), view.positions[:1]
    assert field.seen(eye, -eye / np.linalg.norm(eye)).all()
    assert not field.seen(-eye, eye / np.linalg.norm(eye)).any()


def test_rays_are_added_to_those_of_a_field(tmp_path, capsys):
    scan, below = sphere_scan(24), np.array([[0.0, 0, -1]])
    parts = [tmp_path / "above.npz", tmp_path / "below.npz"]
    for part, kept in zip(parts, (scan.positions[:, 2] > 0, scan.positions[:, 2] <= 0), strict=True):
        scans.write(scan.some(kept), part)
    first, field, both = (str(tmp_path / name) for name in ("first", "field", "both"))
    assert cli.main(["fit", str(parts[0]), first, "--up", "z"]) == 0 and ddf.load(first).up == "z"
    assert not ddf.load(first).seen(below, -below).any()
    for out in (field, field, first):  # into a folder, once more, and into its own
        assert cli.main(["fit", str(parts[1]), out, "--onto", first]) == 0
    assert "made before" in capsys.readouterr().out and ddf.load(field).up == "z"
    assert json.loads((tmp_path / "first/fit.json").read_text())["rays"] == ["../above.npz", "../below.npz"]
    whole = ddf.fit(rays=[scans.read(parts[0]), str(parts[1])], out=both)
    ddf.fit(rays=(str(parts[0]),), out=tmp_path / "python")
    assert cli.main(["fit", str(parts[1]), str(tmp_path / "more"), "--onto", str(tmp_path / "python")]) == 0
    starts, ways = scan.positions[::9], scan.directions[::9]
    for other in (field, first):
        assert np.array_equal(ddf.load(other).query(starts, ways)["depth"], whole.query(starts, ways)["depth"])
        assert ddf.load(other).seen(below, -below).all()
    parts[0].rename(tmp_path / "moved.npz")
    mesh = tmp_path / "ball.ply"
    mesh.write_bytes(mesh_io.ply_bytes(icosphere(2)))
    assert cli.main(["fit", str(mesh), str(tmp_path / "ball")]) == 0
    (tmp_path / "list").mkdir()
    (tmp_path / "list/fit.json").write_text("[]")
    for source, onto, told in (
        (parts[1], first, "is gone"),
        (parts[1], tmp_path / "ball", "was not fitted to rays"),
        (mesh, first, "is a mesh"),
        (parts[1], tmp_path / "list", "was not fitted to rays"),
        (parts[1], tmp_path / "nothing", "nothing"),
    ):
        assert cli.main(["fit", str(source), str(tmp_path / "no"), "--onto", str(onto)]) == 2
        assert told in capsys.readouterr().err and not (tmp_path / "no").exists()


def test_a_fit_to_frames_that_do_not_stand_as_told_is_doubtful(tmp_path, capsys):
    scan = sphere_scan(12, 0.02, 0.1)
    for name, sign, code in (("right", 1, 0), ("wrong", -1, 1)):
        (tmp_path / name).mkdir()
        for i, eye in enumerate(np.unique(scan.positions, axis=0)):
            own = scan.some((scan.positions == eye).all(axis=1))
            scans.write(scans.Scan(own.positions, sign * own.directions, own.ranges), tmp_path / name / f"{i}.npz")
        assert cli.main(["fit", str(tmp_path / name), str(tmp_path / f"field of {name}")]) == code
        assert ("DOUBTFUL: 12 frames agree on 0%" in capsys.readouterr().out) == bool(code)
        remarks = json.loads((tmp_path / f"field of {name}/fit.json").read_text())["remarks"]
        assert len(remarks) == code


def test_the_network_takes_rays_whose_sensors_are_known(of_rays, tmp_path, capsys):
    assert cli.main(["fit", str(of_rays[0] / "scan.npz"), str(tmp_path / "out"), "--steps", "3"]) == 0
    told = capsys.readouterr().out
    assert "held-out rays" in told and "3 steps" in told
    ball = icosphere(3)
    (tmp_path / "cloud.ply").write_bytes(mesh_io.points_ply(ball.vertices, ball.vertices))
    assert cli.main(["fit", str(tmp_path / "cloud.ply"), str(tmp_path / "no"), "--steps", "3"]) == 2
    assert "fitted by patches alone" in capsys.readouterr().err
    with pytest.raises(ValueError, match="to a mesh or to rays"):
        ddf.fit()
