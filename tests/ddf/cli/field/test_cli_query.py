"""`ddf query`: answers in the frame of the mesh; bad rays are one line and exit code 2."""

import json
from pathlib import Path

import numpy as np
import pytest

from ddf import cli
from ddf.fields import field_outputs

ROOT = Path(__file__).resolve().parents[4]


def _rays(path, **arrays):
    np.savez(path, **arrays)
    return path


def test_query_answers_in_the_frame_of_the_mesh(work, fitted, capsys):
    centre = np.array([100.0, 0.0, -50.0])
    starts = centre + np.array([[0.0, 60.0, 0.0], [0.0, 60.0, 0.0], [21.0, 0.0, 0.0], [6e4, 0.0, 0.0]])
    along = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    path = _rays(work / "rays.npz", positions=starts, directions=along)
    arguments = ["query", "--json", str(fitted[0]), "--rays", str(path), "--out", str(work / "out.npz")]
    assert cli.main([*arguments, "--outputs", ",".join(field_outputs.of(2))]) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["rays"], result["evaluated"], result["saved"]) == (4, 3, 1)
    with np.load(work / "out.npz") as found:
        assert set(found.files) == set(field_outputs.of(2))
        assert found["depth"].shape == (4,)
        assert found["normals"].shape == (4, 3)
        assert np.isinf(found["depth"][1])
        assert found["visibility"][1] == 0
        seen = np.isfinite(found["depth"])
        assert np.array_equal(seen, found["visibility"] >= 0.5)
        assert not any(np.isnan(found[name]).any() for name in found.files)


@pytest.mark.parametrize(
    ("arrays", "outputs", "message"),
    [
        (
            {"positions": np.zeros((2, 3)), "directions": np.array([[0, 0, 1.0], [0, 0, 2]])},
            "depth",
            "must be unit length (tol 0.0001); got 2 at index",
        ),
        ({"positions": np.zeros((2, 3))}, "depth", "has no array 'directions'"),
        ({"positions": np.full((1, 3), np.nan), "directions": np.eye(3)[:1]}, "depth", "positions must be finite"),
    ],
)
def test_bad_rays_are_one_line_and_exit_2(work, fitted, arrays, outputs, message, capsys):
    path = _rays(work / "bad.npz", **arrays)
    out = work / "never.npz"
    code = cli.main(["query", str(fitted[0]), "--rays", str(path), "--out", str(out), "--outputs", outputs])
    error = capsys.readouterr().err
    assert code == 2
    assert message in error
    assert error.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize(("outputs", "message"), [("colour", "must be among visibility, "), ("", "got none")])
def test_unknown_outputs_are_one_line_and_exit_2(fitted, outputs, message, capsys):
    with pytest.raises(SystemExit) as caught:
        cli.main(["query", str(fitted[0]), "--rays", "no.npz", "--out", "never.npz", "--outputs", outputs])
    assert caught.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith("ddf query: error: argument --outputs: must be among") and message in error
    assert error.count("\n") == 1
