"""`ddf mesh` end to end."""

import json

import numpy as np
import pytest
from _support import assert_close

from ddf import cli
from ddf.data import mesh_topology
from ddf.geometry import mesh_io, transforms

MESH_KEYS = {"watertight", "faces", "hausdorff", "mean_distance", "seconds", "transform"}


def test_mesh_writes_a_closed_mesh_in_the_field_frame(soup, tmp_path, capfd):
    out = tmp_path / "closed.obj"
    assert cli.main(["mesh", str(soup), str(out), "--faces", "500", "--alpha", "0.05", "--json"]) == 0
    answer = json.loads(capfd.readouterr().out)
    assert answer.keys() >= MESH_KEYS and answer["watertight"] is True and answer["faces"] <= 500
    mesh = mesh_io.load(out)
    assert len(mesh.faces) == answer["faces"] and mesh_topology.is_watertight(mesh)
    lower, upper = mesh.box()
    assert_close(np.stack([lower + upper]), np.zeros((1, 3)), atol=1e-12)
    assert_close((upper - lower).max(), np.array(2.0), atol=1e-12)
    transform = transforms.Similarity.from_dict(answer["transform"])
    assert_close(transform.apply(np.array([[1e4, 0, -1e4]])), np.zeros((1, 3)), atol=0.2)
    assert 0 < answer["mean_distance_seen"] < answer["hausdorff_seen"] < 0.05
    assert answer["hausdorff"] == pytest.approx(answer["hausdorff_hidden"], rel=0.1)  # the ball inside is gone
    assert "hidden parts" in answer["outcome"]


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["mesh", "{none}", "{out}.ply"], "no such file"),
        (["mesh", "{folder}", "{out}.ply"], "not a file"),
        (["mesh", "{soup}", "{out}.doc"], "must end in"),
        (["mesh", "{soup}", "{out}.ply", "--faces", "1"], "faces must be >= 4"),
        (["mesh", "{soup}", "{out}.ply", "--alpha", "2"], "alpha must be <= 0.5; got 2.0"),
    ],
)
def test_bad_input_is_one_line_and_code_two(arguments, reason, refuses):
    refuses(arguments, reason)
