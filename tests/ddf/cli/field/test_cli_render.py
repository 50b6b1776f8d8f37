"""`ddf render`: pictures and arrays of what a camera sees."""

import numpy as np
import OpenEXR
import pytest
from PIL import Image, ImageSequence

from ddf.fields import field_outputs, framed_field, shape_field
from ddf.geometry import rays


@pytest.fixture
def rendered(fitted, answer):
    """What `ddf render` of the fitted field says, of 32 pixels a side."""
    return lambda out, *extra: answer("render", fitted[0], out, "--size", 32, *extra)


@pytest.mark.parametrize("output", tuple(field_outputs.OUTPUTS))
def test_render_writes_a_picture(tmp_path, rendered, output):
    result = rendered(tmp_path / "a.png", "--output", output, "--camera=-30,20,1.0", "--up", "z")
    assert 0 < result["evaluated"] == 32 * 32 - result["saved"] < 32 * 32
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == (32, 32) and picture.mode == "RGB"


def test_pictures_are_shaded_and_turn(tmp_path, rendered):
    out = tmp_path / "turn.webp"
    result = rendered(out, "--turn", 3)
    assert (result["output"], result["frames"], result["pixels"]) == ("shaded", 3, 3 * 32**2)
    assert result["evaluated"] > result["pixels"]
    with Image.open(out) as picture:
        assert (picture.size, len(list(ImageSequence.Iterator(picture)))) == ((32, 32), 3)
    assert rendered(out, "--camera", "0,0,0")["camera"]["radius"] == 0  # as asked, not framed


def test_the_file_s_name_says_what_it_holds_and_all_hold_the_same(tmp_path, rendered):
    names = ("visibility", "depth", "normals")
    result = rendered(tmp_path / "all.npz", "--output", ",".join(names))
    with np.load(tmp_path / "all.npz") as file:
        arrays = {name: file[name] for name in file.files}
    assert tuple(arrays) == names and {array.dtype for array in arrays.values()} == {np.dtype(np.float64)}
    seen = np.isfinite(arrays["depth"])
    assert 0 < seen.sum() == result["seen"] < 32 * 32
    assert result["range"]["depth"] == {
        "min": pytest.approx(arrays["depth"][seen].min()),
        "max": pytest.approx(arrays["depth"][seen].max()),
        "unit": "mesh units along the ray",
    }
    rendered(tmp_path / "all.exr", "--output", ",".join(names))
    with OpenEXR.File(str(tmp_path / "all.exr"), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
    assert channels.keys() == {"visibility", "depth", "normals.X", "normals.Y", "normals.Z"}
    assert np.array_equal(channels["depth"], arrays["depth"].astype(np.float32))
    assert np.array_equal(channels["normals.Y"], arrays["normals"][..., 1])
    step = rendered(tmp_path / "depth16.png", "--bits", 16)["depth_step"]
    with Image.open(tmp_path / "depth16.png") as picture:
        levels, note = np.array(picture), picture.info["depth_step"]
    assert levels.max() == 65535 and float(note) == step and np.array_equal(levels > 0, seen)
    assert np.abs(levels[seen] * step - arrays["depth"][seen]).max() <= 0.51 * step
    for suffix in (".png", ".webp"):
        rendered(tmp_path / f"same{suffix}", "--output", "normals")
    with Image.open(tmp_path / "same.png") as one, Image.open(tmp_path / "same.webp") as other:
        assert np.array_equal(np.array(one), np.array(other.convert("RGB")))


@pytest.mark.parametrize("view", ["-30,10", "80,-60", "10,90"])
@pytest.mark.parametrize("up", ["y", "z"])
def test_the_box_just_fits_the_picture_of_a_camera_without_a_distance(tmp_path, fitted, view, up, rendered):
    """A ray through a pixel of the border misses the box, and one within the margin meets it."""
    result = rendered(tmp_path / "framed.npz", "--camera", view, "--up", up)
    shape = shape_field.load(fitted[0])
    camera = tuple(result["camera"][name] for name in ("azimuth_deg", "elevation_deg", "radius"))
    starts, along = framed_field.camera_rays(shape, camera, 80, up)
    *_, meets = rays.enter_box(starts, along, shape.lower, shape.upper)
    picture = np.asarray(meets).reshape(80, 80)
    assert not (picture[0].any() or picture[-1].any() or picture[:, 0].any() or picture[:, -1].any())
    rows, columns = np.flatnonzero(picture.any(axis=1)), np.flatnonzero(picture.any(axis=0))
    assert min(rows[0], 79 - rows[-1], columns[0], 79 - columns[-1]) <= 3  # the margin is 5 % of 40 pixels
