"""`ddf render`: pictures and arrays of what a camera sees; bad input is one line and exit code 2."""

import json
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image, ImageSequence

from ddf import cli
from ddf.core import shipped_models
from ddf.fields import field_outputs, framed_field, shape_field
from ddf.geometry import rays

ROOT = Path(__file__).resolve().parents[4]


@pytest.mark.parametrize("output", field_outputs.of(2))
def test_render_writes_a_picture(work, fitted, output, capsys):
    out = work / f"{output}.png"
    arguments = ["render", "--json", str(fitted[0]), str(out), "--size", "24", "--output", output]
    assert cli.main([*arguments, "--camera=-30,20,1.0", "--up", "z"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert 0 < result["evaluated"] < 24 * 24
    assert result["evaluated"] + result["saved"] == 24 * 24
    with Image.open(out) as picture:
        assert picture.size == (24, 24)
        assert picture.mode == "RGB"


def test_pictures_are_shaded_and_turn(work, fitted, capsys):
    out = work / "turn.webp"
    assert cli.main(["render", "--json", str(fitted[0]), str(out), "--size", "24", "--turn", "3"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["output"], result["frames"], result["pixels"]) == ("shaded", 3, 3 * 24**2)
    assert result["evaluated"] > result["pixels"]
    assert cli.main(["render", "--json", str(fitted[0]), str(out), "--size", "4", "--camera", "0,0,0"]) == 0
    assert json.loads(capsys.readouterr().out)["camera"]["radius"] == 0  # as asked, not framed
    assert cli.main(["render", str(fitted[0]), str(out), "--size", "24", "--turn", "3"]) == 0
    with Image.open(out) as picture:
        assert (picture.size, len(list(ImageSequence.Iterator(picture)))) == ((24, 24), 3)


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--camera", "1,2,-1"], "camera radius >= 0"),
        (["--camera", "1,2,nan"], "camera must be finite"),
        (["--camera", "inf,2"], "camera must be finite"),
        (["--output", "depth,normals"], "a picture shows one output, .npz and .exr hold 2"),
        (["--bits", "16", "--output", "normals"], "--bits 16 is for the depth in a .png"),
    ],
)
def test_bad_renders_are_one_line_and_exit_2(work, fitted, extra, message, capsys):
    assert cli.main(["render", str(fitted[0]), str(work / "never.png"), *extra]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--camera", "1"], "must be two or three numbers az,el[,r]; got '1'"),
        (["--camera", "a,b,c"], "must be two or three numbers az,el[,r]; got 'a,b,c'"),
        (["--camera", "1,2,3,4"], "must be two or three numbers"),
        (["--size", "0"], "must be a whole number, 1 to 8192; got '0'"),
        (["--size", "1000000"], "must be a whole number, 1 to 8192"),
        (["--turn", "1"], "must be a whole number, 2 to 360; got '1'"),
        (["--output", "colour"], "must be among visibility, depth, normals"),
    ],
)
def test_wrong_arguments_are_one_line_before_anything_is_read(extra, message, capsys):
    with pytest.raises(SystemExit) as caught:
        cli.main(["render", "nothing", "never.png", *extra])
    assert caught.value.code == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1


@pytest.mark.parametrize("name", ["picture.jpg", "picture", "p.tiff"])
def test_a_file_of_another_kind_is_refused(work, fitted, name, capsys):
    assert cli.main(["render", str(fitted[0]), str(work / name)]) == 2
    assert f"{name}: must end in one of .png, .webp, .npz, .exr" in capsys.readouterr().err


def _rendered(fitted, out, capsys, *extra):
    """The JSON of a render of 32 pixels a side."""
    assert cli.main(["render", "--json", str(fitted[0]), str(out), "--size", "32", *extra]) == 0
    return json.loads(capsys.readouterr().out)


def test_the_file_s_name_says_what_it_holds_and_all_hold_the_same(work, fitted, capsys):
    names = ("visibility", "depth", "normals")
    result = _rendered(fitted, work / "all.npz", capsys, "--output", ",".join(names))
    with np.load(work / "all.npz") as file:
        arrays = {name: file[name] for name in file.files}
    assert tuple(arrays) == names and {array.dtype for array in arrays.values()} == {np.dtype(np.float32)}
    seen = np.isfinite(arrays["depth"])
    assert 0 < seen.sum() == result["seen"] < 32 * 32
    found = result["range"]["depth"]
    assert found == {
        "min": pytest.approx(arrays["depth"][seen].min()),
        "max": pytest.approx(arrays["depth"][seen].max()),
        "unit": "mesh units along the ray",
    }
    _rendered(fitted, work / "all.exr", capsys, "--output", ",".join(names))
    with OpenEXR.File(str(work / "all.exr"), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
    assert channels.keys() == {"visibility", "depth", "normals.X", "normals.Y", "normals.Z"}
    assert np.array_equal(channels["depth"], arrays["depth"])
    assert np.array_equal(channels["normals.Y"], arrays["normals"][..., 1])
    step = _rendered(fitted, work / "depth16.png", capsys, "--bits", "16")["depth_step"]
    with Image.open(work / "depth16.png") as picture:
        levels, note = np.array(picture), picture.info["depth_step"]
    assert levels.max() == 65535 and float(note) == step and np.array_equal(levels > 0, seen)
    assert np.abs(levels[seen] * step - arrays["depth"][seen]).max() <= 0.51 * step
    for suffix in (".png", ".webp"):
        _rendered(fitted, work / f"same{suffix}", capsys, "--output", "normals")
    with Image.open(work / "same.png") as one, Image.open(work / "same.webp") as other:
        assert np.array_equal(np.array(one), np.array(other.convert("RGB")))


@pytest.mark.parametrize("view", ["-30,10", "80,-60", "10,90"])
@pytest.mark.parametrize("up", ["y", "z"])
def test_the_box_just_fits_the_picture_of_a_camera_without_a_distance(work, fitted, view, up, capsys):
    """A ray through a pixel of the border misses the box, and one within the margin meets it."""
    result = _rendered(fitted, work / "framed.npz", capsys, "--camera", view, "--up", up)
    shape = shape_field.load(fitted[0])
    camera = tuple(result["camera"][name] for name in ("azimuth_deg", "elevation_deg", "radius"))
    starts, along = framed_field.camera_rays(shape, camera, 80, up)
    *_, meets = rays.enter_box(starts, along, shape.lower, shape.upper)
    picture = np.asarray(meets).reshape(80, 80)
    assert not (picture[0].any() or picture[-1].any() or picture[:, 0].any() or picture[:, -1].any())
    rows, columns = np.flatnonzero(picture.any(axis=1)), np.flatnonzero(picture.any(axis=0))
    assert min(rows[0], 79 - rows[-1], columns[0], 79 - columns[-1]) <= 3  # the margin is 5 % of 40 pixels


def test_a_camera_that_sees_nothing_gives_no_range(work, fitted, capsys):
    assert (
        cli.main(
            [
                "render",
                str(fitted[0]),
                str(work / "none.png"),
                "--size",
                "4",
                "--output",
                "depth",
                "--camera",
                "0,0,1e6",
            ]
        )
        == 0
    )
    shown = capsys.readouterr().out.splitlines()
    assert shown[1].split()[:3] == ["depth", "–", "–"] and "0% of them see the object" in shown[2]
    found = _rendered(fitted, work / "none.npz", capsys, "--camera", "0,0,1e6")["range"]["depth"]
    assert (found["min"], found["max"]) == (None, None)


def test_a_name_of_a_shipped_field_is_a_field(work, capsys):
    (name, *_) = (model.name for model in shipped_models.listed() if model.kind == "field")
    assert cli.main(["render", "--json", name, str(work / "shipped.png"), "--size", "16"]) == 0
    assert json.loads(capsys.readouterr().out)["seen"] > 10


def test_something_else_than_a_field_is_refused(work, fitted, capsys):
    assert cli.main(["render", str(work / "nothing"), str(work / "never.png")]) == 2
    assert "no such file or folder, and no field of that name; there are rabbit, " in capsys.readouterr().err
    damaged = work / "damaged"
    damaged.mkdir()
    data = bytearray((fitted[0] / "model.safetensors").read_bytes())
    data[-5] ^= 1
    (damaged / "model.safetensors").write_bytes(data)
    assert cli.main(["render", str(damaged), str(work / "never.png")]) == 2
    assert "is damaged" in capsys.readouterr().err
