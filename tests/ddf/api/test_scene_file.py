"""Scene files: what they say is what is composed; what is wrong in them is one line that names file and key."""

import numpy as np
import pytest
import yaml

import ddf
from ddf.core import checks

PATH = {"position": [0, 0, 3], "target": [0, 0, 0]}


def _write(folder, content):
    file = folder / "scene.yaml"
    file.write_text(content if isinstance(content, str) else yaml.safe_dump(content))
    return file


def test_scene_of_a_file_is_the_scene_composed(tmp_path):
    beside = {"field": "rabbit", "scale": 0.5, "rotation_deg": [90, 0, 90], "translation": [1.5, 0.1, 0.0]}
    scene = ddf.read_scene(_write(tmp_path, {"objects": [{"field": "rabbit"}, beside], "up": "z", "soft": 0.3}))
    matrix = np.eye(4)
    matrix[:3, :3] = 0.5 * np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # x -> x -> y, y -> z -> z, z -> -y -> x
    matrix[:3, 3] = 1.5, 0.1, 0.0
    rabbit = ddf.load("rabbit")
    composed = ddf.compose([rabbit, rabbit], [np.eye(4), matrix], soft=0.3)
    np.testing.assert_allclose(scene.box, composed.box)
    found, expected = (each.render(0, 10, size=16)["depth"] for each in (scene, composed))  # one behind the other
    np.testing.assert_allclose(scene.render(0, 10, size=16, up="y")["depth"], expected, atol=1e-5)
    np.testing.assert_allclose(found, composed.render(0, 10, size=16, up="z")["depth"], atol=1e-5)  # as the file has it


def test_a_box_cuts_away_what_lies_before_it(tmp_path):
    front, along = [[0.0, 0.45, 5.0]], [[0.0, 0.0, -1.0]]
    objects = [{"field": "rabbit"}, {"field": "rabbit", "translation": [0, 0, -3]}]
    whole = ddf.read_scene(_write(tmp_path, {"objects": objects})).query(front, along)["depth"]
    box = {"lower": [-1, -1, -4], "upper": [1, 2, -1.2]}
    cut = ddf.read_scene(_write(tmp_path, {"objects": objects, "box": box})).query(front, along)["depth"]
    assert cut[0] == pytest.approx(whole[0] + 3, abs=2e-3)


def test_paths_of_fields_begin_at_the_scene_file(tmp_path, monkeypatch):
    (tmp_path / "mine.onnx").write_bytes(b"nothing")
    with pytest.raises(checks.InputError, match=rf"{tmp_path}/mine\.onnx: not an ONNX file"):
        ddf.read_scene(_write(tmp_path, {"objects": [{"field": "mine.onnx"}]}))
    (tmp_path / "elsewhere" / "rabbit").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert ddf.read_scene(_write(tmp_path, {"objects": [{"field": "rabbit"}]})).outputs


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("objects: [", "not valid YAML"),
        ({"objects": []}, "objects must list one field or more"),
        ({"objects": [{"scale": 2.0}]}, r"scene\.objects\[0\]: key 'field' is missing"),
        ({"objects": [{"field": "rabbit", "scale": 0.0}]}, r"scale must be positive, in .*; got 0"),
        ({"objects": [{"field": "rabbit", "translation": [1e300, 0, 0]}]}, r"must be within 1e\+100"),
        ({"objects": [{"field": "hare"}]}, r"scene\.objects: field 'hare': .*hare: no such file"),
        ({"objects": [{"field": "scene.yaml"}]}, "is no field: give a folder"),
        ({"objects": [{"field": "rabbit", "turn": 1}]}, "unknown key 'turn'"),
        ({"objects": [{"field": "rabbit"}], "soft": -1.0}, "soft must be positive, or null"),
        ({"objects": [{"field": "rabbit"}], "box": {"lower": [0, 0, 0], "upper": [1, 0, 1]}}, "lower must be below"),
        ({"objects": [{"field": "rabbit"}], "fly": [PATH | {"target": [0, 0, 3]}]}, "must look away"),
    ],
)
def test_what_is_wrong_in_a_file_is_named(content, message, tmp_path):
    file = _write(tmp_path, content)
    with pytest.raises(checks.InputError, match=message) as caught:
        ddf.read_scene(file)
    assert str(file) in str(caught.value) and "\n" not in str(caught.value)
