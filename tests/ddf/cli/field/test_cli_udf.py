"""`ddf udf`: distances as the Python interface gives them; bad points are one line and exit code 2."""

import json

import numpy as np
import pytest

import ddf
from ddf import cli


def test_distances_are_those_of_the_interface(tmp_path, capsys):
    positions = np.array([[0.0, 3.0, 0.0], [0.0, 0.0, 2.0]])
    np.savez(tmp_path / "p.npz", positions=positions)
    assert (
        cli.main(["udf", "rabbit", "--points", str(tmp_path / "p.npz"), "--out", str(tmp_path / "u.npz"), "--json"])
        == 0
    )
    result = json.loads(capsys.readouterr().out)
    distances, directions = ddf.load("rabbit").udf(positions)
    with np.load(tmp_path / "u.npz") as found:
        np.testing.assert_allclose(found["distances"], distances, atol=1e-5)
        np.testing.assert_allclose(found["directions"], directions, atol=1e-5)
    assert result["points"] == 2 and result["least"] == pytest.approx(distances.min())


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"other": np.zeros((2, 3))}, "has no array 'positions'"),
        ({"positions": np.zeros((2, 2))}, "positions must be numbers of shape (N, 3)"),
        ({"positions": np.full((1, 3), np.nan)}, "positions must be finite"),
        (None, "No such file"),
    ],
)
def test_bad_points_are_one_line_and_exit_2(arrays, message, tmp_path, capsys):
    if arrays is not None:
        np.savez(tmp_path / "p.npz", **arrays)
    assert cli.main(["udf", "rabbit", "--points", str(tmp_path / "p.npz"), "--out", str(tmp_path / "u.npz")]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1 and not (tmp_path / "u.npz").exists()
