"""An object on tables, walls and masks is cut out as its own alpha has it; what cannot be told is said."""

from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageDraw

from ddf.core import checks
from ddf.data import cutouts

SIZE = (240, 180)


def _object():
    """A brown chair of sorts, with a hole and thin legs, on transparent pixels."""
    big = Image.new("RGBA", (4 * SIZE[0], 4 * SIZE[1]))
    pen = ImageDraw.Draw(big)
    pen.rectangle((400, 120, 640, 420), fill=(120, 70, 30, 255))
    pen.rectangle((470, 190, 570, 300), fill=(0, 0, 0, 0))
    for x in (404, 620):
        pen.rectangle((x, 420, x + 16, 600), fill=(150, 100, 50, 255))
    return big.resize(SIZE, Image.Resampling.BOX)


def _on(behind):
    return Image.alpha_composite(Image.fromarray(behind.astype(np.uint8)).convert("RGBA"), _object()).convert("RGB")


def _table():
    """White, darker towards one corner, with noise."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]] / 240
    light = 250 - 25 * x - 12 * y * y
    return np.stack([light, light - 3, light - 8], axis=-1) + np.random.default_rng(0).normal(0, 1.5, (*x.shape, 3))


def _apart(path, **how):
    """Mean difference of alpha from the truth, in opaque pixels of it."""
    truth, found = np.array(_object())[..., 3] / 255, cutouts.read(path, **how)
    assert found.dtype == np.uint8 and (found[found[..., 3] == 0] == 0).all()
    return np.abs(found[..., 3] / 255 - truth).sum() / truth.sum()


def test_a_jpeg_on_a_white_table_a_wall_and_a_mask(tmp_path):
    _object().save(tmp_path / "cut.png")
    _on(_table()).save(tmp_path / "table.jpg", quality=90)
    _on(np.broadcast_to([40, 120, 190], (SIZE[1], SIZE[0], 3))).save(tmp_path / "wall.png")
    _object().getchannel("A").resize((480, 360)).save(tmp_path / "mask.png")
    assert _apart(tmp_path / "cut.png") == 0
    assert _apart(tmp_path / "table.jpg") < 0.03
    for how in ({}, {"background": "border"}, {"background": "#2878be"}, {"background": "rgb(40, 120, 190)"}):
        assert _apart(tmp_path / "wall.png", **how) < 0.01
    assert _apart(tmp_path / "wall.png", mask=tmp_path / "mask.png") < 0.05
    colours = cutouts.read(tmp_path / "wall.png")[np.array(_object())[..., 3] > 100][:, :3]
    truth = np.array(_object())[np.array(_object())[..., 3] > 100][:, :3]
    assert np.abs(colours.astype(int) - truth).mean() < 3  # the wall is taken out of the edges


@pytest.mark.parametrize("name", ["L.png", "LA.png", "I;16.png", "CMYK.jpg", "RGB.bmp"])
def test_pictures_of_every_mode(tmp_path, name):
    mode = name[:-4]
    if mode == "LA":
        picture = _object().convert("LA")
    elif mode == "I;16":
        picture = Image.fromarray(257 * np.array(_on(_table()).convert("L")).astype(np.uint16))
    else:
        picture = _on(_table()).convert(mode)
    picture.save(tmp_path / name)
    assert _apart(tmp_path / name) < 0.04


@pytest.mark.parametrize(
    ("tag", "undo"), [(3, Image.Transpose.ROTATE_180), (6, Image.Transpose.ROTATE_90), (8, Image.Transpose.ROTATE_270)]
)
def test_photographs_are_turned_as_their_exif_says(tmp_path, tag, undo):
    exif = Image.Exif()
    exif[0x0112] = tag
    _object().transpose(undo).save(tmp_path / "turned.png", exif=exif)
    assert _apart(tmp_path / "turned.png") == 0


def test_long_strips_keep_their_place_in_bounded_memory(tmp_path):
    strip = np.zeros((40, 16000, 4), np.uint8)
    strip[:, :8000] = (255, 0, 0, 255)
    Image.fromarray(strip).save(tmp_path / "strip.png")
    image = cutouts.read(tmp_path / "strip.png")
    assert image.shape == (3, 1024, 4) and (image[:, 514:] == 0).all() and image[:, :510, 3].min() > 0


def test_what_cannot_be_cut_out_is_said(tmp_path):
    Image.new("RGB", (40, 40), "red").save(tmp_path / "plain.png")
    Image.new("RGBA", (40, 40)).save(tmp_path / "clear.png")
    for name, size in (("wide.png", (90, 40)), ("wide.tif", (90, 40)), ("all.png", (40, 40))):
        Image.new("L", size, 255).save(tmp_path / name)
    Image.new("RGBA", (7200, 7200)).save(tmp_path / "large.png")
    Image.fromarray(RIM[:40, :40].astype(np.uint8)).save(tmp_path / "dark.png")  # several dark values
    whole = {"mask": tmp_path / "all.png"}
    cases: tuple[tuple[str, dict[str, Any], str], ...] = (
        ("plain.png", {}, "no object stands out from the background .what does is 0 pixels across, 0% of"),
        ("clear.png", {}, "is masked .what does is at most 0 of 255; the object's are 128 or more.; give --mask"),
        ("clear.png", {"mask": tmp_path / "wide.tif"}, "wide.tif: not a readable image .damaged, or of another kind.;"),
        ("plain.png", whole, "all.png: no object is masked .what does is 40 pixels across, 100% of"),
        ("large.png", {}, r"large\.png: 7200 x 7200 pixels; at most 50000000"),
        ("plain.png", {"background": "gren"}, "background must be auto, white, border"),
        ("plain.png", {"mask": tmp_path / "wide.png"}, "wide.png: 90 x 40 pixels, not of the picture"),
        ("plain.png", {"mask": tmp_path / "dark.png"}, "dark.png: no object is masked .what does is at most 2 of"),
    )
    for name, how, message in cases:
        with pytest.raises(checks.InputError, match=message):
            cutouts.read(tmp_path / name, **how)


def _palette(steps, *colours):
    found = Image.fromarray(steps.astype(np.uint8)).convert("P")
    found.putdata(steps.ravel().tolist())
    found.putpalette(np.array(colours, np.uint8).ravel().tolist())
    return found


SHAPE = np.zeros((90, 120), int)
SHAPE[20:70, 30:90] = 1
RIM = np.where(SHAPE == 1, 1, 0)
RIM[20:70, 30] = 2
MASKS = {
    "0 and 1": Image.fromarray(SHAPE.astype(np.uint8)),
    "0 and 127": Image.fromarray((127 * SHAPE).astype(np.uint8)),
    "16 bits, 0 and 1": Image.fromarray(SHAPE.astype(np.uint16)),
    "16 bits, 0 and 65535": Image.fromarray((65535 * SHAPE).astype(np.uint16)),
    "16 bits, soft": Image.fromarray((60000 * SHAPE + np.arange(120)).astype(np.uint16)),
    "16 bits, bytes": Image.fromarray((200 * SHAPE + np.arange(120) // 4).astype(np.uint16)),
    "1 bit": Image.fromarray(SHAPE == 1),
    "dark red with a light rim": _palette(RIM, (0, 0, 0), (64, 0, 0), (224, 224, 192)),
    "grey palette in another order": _palette(1 - SHAPE, (255, 255, 255), (0, 0, 0)),
    "alpha of 0 and 127": Image.fromarray(np.stack([*[0 * SHAPE] * 3, 127 * SHAPE], -1).astype(np.uint8)),
    "soft": Image.fromarray((200 * SHAPE + np.arange(120) // 4).astype(np.uint8)),
}


@pytest.mark.parametrize("kind", MASKS)
def test_masks_of_every_kind_are_one_mask(kind, tmp_path):
    Image.new("RGB", (120, 90), "olive").save(tmp_path / "a.png")
    MASKS[kind].save(tmp_path / "mask.png")
    found = cutouts.read(tmp_path / "a.png", mask=tmp_path / "mask.png")[..., 3]
    np.testing.assert_array_equal(found >= 128, SHAPE == 1)
