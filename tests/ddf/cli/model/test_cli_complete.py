import json

import numpy as np
import pytest

import ddf
from ddf import cli
from ddf.core import shipped_models
from ddf.fit import completion
from ddf.geometry import mesh_io, scans


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    defaults = dict(rays=100, draws=8, starts=1, kept=1, axes=8, steps=4, samples=4)
    whole = completion.CompletionConfig
    monkeypatch.setattr(completion, "CompletionConfig", lambda: whole(**defaults))


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    image = shipped_models.ROOT / "chair" / "sample_0.png"
    sweep = ddf.depth_camera(ddf.reconstruct(image, "chair", n=100).field, size=24)
    sweep.save(tmp_path_factory.mktemp("scan") / "scan.npz")
    return tmp_path_factory.getbasetemp() / "scan0" / "scan.npz"


def _pose(path, scale):
    path.write_text(json.dumps(np.diag([scale, scale, scale, 1.0]).tolist()))
    return str(path)


def test_complete_writes_a_field_that_loads_and_clouds(scan, tmp_path, capsys):
    pose = _pose(tmp_path / "pose.json", 0.32)
    arguments = [
        "complete",
        "--json",
        str(scan),
        "chair",
        str(tmp_path / "out"),
        "--pose",
        pose,
        "--fixed",
        "-n",
        "200",
    ]
    assert cli.main(arguments) == 0
    result = json.loads(capsys.readouterr().out)
    np.testing.assert_allclose(result["pose"], np.diag([0.32, 0.32, 0.32, 1.0]))
    seen, inferred = (mesh_io.read_points(tmp_path / "out" / f"{name}.ply") for name in ("seen", "inferred"))
    assert len(seen) + len(inferred) == 200 and result["seen"] == pytest.approx(len(seen) / 200)
    with np.load(tmp_path / "out" / "cloud.npz") as arrays:
        np.testing.assert_allclose(arrays["points"][arrays["seen"].astype(bool)], seen, atol=1e-6)
        assert arrays["residuals"].shape == (576,) and arrays["spread"].shape == (200,)
    field = ddf.load(tmp_path / "out")
    given = scans.read(scan)
    depth = field.query(given.positions, given.directions)["depth"]
    both = np.isfinite(depth) & given.hit
    assert both.sum() > 20
    with np.load(tmp_path / "out" / "cloud.npz") as arrays:
        residuals = arrays["residuals"][both]
    np.testing.assert_allclose(given.ranges[both] - depth[both], residuals, atol=2e-3)
    assert result["residual_median"] == pytest.approx(np.median(np.abs(residuals)), abs=2e-3)


BAD = {
    "fixed": ([], ["--fixed"], "--fixed needs --pose"),
    "noise": ([], ["--noise", "-1"], "noise must be 0 or more"),
    "points": ([], ["-n", "1"], "n must be a whole number, 2 or more"),
    "metres": (0.00032, [], "are ranges in millimetres"),
    "pose": ("{}", [], "must hold a 4x4 matrix as JSON"),
    "shear": ("[[1,1,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]", [], "shears or mirrors"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_calls_are_one_line(name, scan, tmp_path, capsys):
    pose, extra, message = BAD[name]
    if pose:
        file = tmp_path / "pose.json"
        if isinstance(pose, float):
            _pose(file, pose)
        else:
            file.write_text(pose)
        extra = [*extra, "--pose", str(file)]
    assert cli.main(["complete", str(scan), "chair", str(tmp_path / "out"), *extra]) == 2
    said = capsys.readouterr().err
    assert message in said and len(said.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()
