"""`ddf render` of scene files: pictures and arrays of several fields; queries are counted."""

import numpy as np
import pytest
from PIL import Image

import ddf

SCENE = """
objects:
  - field: rabbit
  - {field: rabbit, scale: 0.5, translation: [1.2, 0, 0]}
fly:
  - {position: [0, 0.5, 5], target: [0, 0.5, 0]}
  - {position: [0.5, 0.5, 2], target: [0.5, 0.5, 0]}
"""


@pytest.fixture
def scene(tmp_path):
    (tmp_path / "scene.yaml").write_text(SCENE)
    return tmp_path / "scene.yaml"


def test_arrays_are_those_of_the_interface(scene, tmp_path, answer):
    words = ("--size", 24, "--output", "depth,normals", "--camera", "20,10")
    result = answer("render", scene, tmp_path / "seen.npz", *words)
    pictures = ddf.read_scene(scene).render(20, 10, size=24, outputs=("depth", "normals"))
    with np.load(tmp_path / "seen.npz") as found:
        for name, values in pictures.items():
            seen = np.isfinite(pictures["depth"]) & np.isfinite(found["depth"])
            assert found[name].shape == values.shape and seen.sum() > 30
            np.testing.assert_allclose(np.median(np.abs(found[name][seen] - values[seen])), 0.0, atol=1e-5)
    assert result["frames"] == 1 and result["pixels"] == 576
    assert result["evaluated"] + result["saved"] == 2 * 576 and 50 < result["evaluated"] < 700
    assert result["seen"] == pytest.approx(np.isfinite(pictures["depth"]).sum(), abs=6)


@pytest.mark.parametrize("suffix", ["png", "webp"])
def test_a_path_is_moving_pictures(suffix, scene, tmp_path, answer):
    file = tmp_path / f"moving.{suffix}"
    assert answer("render", scene, file, "--output", "depth", "--fly", 3, "--size", 16)["frames"] == 3
    with Image.open(file) as image:
        assert image.size == (16, 16) and getattr(image, "n_frames", 1) == 3
        shares = []
        for i in range(3):
            image.seek(i)
            shares.append((np.asarray(image.convert("RGB")) < 255).any(axis=-1).mean())
    assert 0 < shares[0] < shares[2]  # it comes nearer


def test_a_shaded_scene_has_shadows_of_one_object_on_the_other(scene, tmp_path, answer):
    wall = "{field: armchair, scale: 3, translation: [1.5, 0, -3]}"
    shown = []
    for objects in (f"[{wall}]", f"[{wall}, {{field: rabbit}}]"):
        scene.write_text(f"objects: {objects}\nbox: {{lower: [-4, -2, -6], upper: [4, 2, 2]}}")
        result = answer("render", scene, tmp_path / "a.png", "--camera", "90,10,0.8", "--size", 64)
        assert result["output"] == "shaded" and 0 < result["evaluated"] < result["saved"]
        shown.append(np.asarray(Image.open(tmp_path / "a.png")).astype(int))
    rabbit = ddf.read_scene(scene).render(90, 10, 0.8, size=64)["depth"] < 3
    darker = (shown[0] - shown[1]).min(axis=-1) > 20
    assert (darker & ~rabbit).sum() > 10


@pytest.mark.parametrize("path", ["turn", "fly"])
def test_arrays_of_a_path_have_an_axis_of_frames(path, scene, tmp_path, answer):
    scene.write_text(SCENE.partition("fly")[0])
    answer("render", scene, tmp_path / "a.npz", f"--{path}", 4, "--size", 12)
    with np.load(tmp_path / "a.npz") as found:
        depth = found["depth"]
    assert depth.shape == (4, 12, 12) and np.isfinite(depth).any(axis=(1, 2)).all()
    assert (np.abs(np.diff(np.isfinite(depth).astype(int), axis=0)).sum(axis=(1, 2)) > 0).all()
