"""One object in many pictures is one shape: on a table, in a corner, turned by EXIF, as its own cut-out."""

import numpy as np
import pytest
import torch
from PIL import Image

from ddf.core import shipped_models
from ddf.data import cutouts
from ddf.models import line_field
from ddf.reconstruction import framing


def _pictures(folder, shown):
    """A cut-out, and photographs of it: a JPEG on a white table, an RGB PNG in a corner, one turned by EXIF."""
    canvas, corner = Image.new("RGBA", (600, 450)), Image.new("RGBA", (800, 600))
    canvas.paste(shown, (90, 20))
    corner.paste(shown, (790 - shown.width, 590 - shown.height))
    canvas.save(folder / "cut.png")
    light = np.linspace(250, 238, 600)[None, :, None] + np.random.default_rng(0).normal(0, 1.2, (450, 600, 3))
    table = Image.fromarray(light.clip(0, 255).astype(np.uint8)).convert("RGBA")
    photo = Image.alpha_composite(table, canvas).convert("RGB")
    photo.save(folder / "table.jpg", quality=90)
    turned = Image.Exif()
    turned[0x0112] = 6
    photo.transpose(Image.Transpose.ROTATE_90).save(folder / "turned.jpg", quality=92, exif=turned)
    blue = Image.new("RGBA", corner.size, (60, 110, 160, 255))
    Image.alpha_composite(blue, corner).convert("RGB").save(folder / "corner.png")


def test_every_picture_of_a_chair_gives_its_shape(tmp_path):
    folder = shipped_models.place("chair")
    trained = line_field.load(folder)
    _pictures(tmp_path, Image.open(folder / "sample_1.png").resize((411, 411)))

    @torch.no_grad()
    def context(path):
        cutout = framing.Cutout(cutouts.read(path))
        framed = framing.encoder_input(cutout.crop(framing.frame(trained, cutout), trained.image_size))
        return trained.network.shape_encoder.look(framed)[1]

    own = context(tmp_path / "cut.png")
    apart = float((context(folder / "sample_2.png") - own).norm())
    for name in ("table.jpg", "corner.png", "turned.jpg"):
        assert float((context(tmp_path / name) - own).norm()) < 0.4 * apart


@pytest.mark.parametrize("size", [64, 137])
def test_a_square_picture_in_which_the_object_stands_free_is_left_as_it_is(size):
    pixels = np.zeros((137, 137, 4), np.uint8)
    pixels[40:100, 30:90] = (200, 100, 50, 255)
    cutout = framing.Cutout(pixels)
    assert cutout.given is not None
    assert cutout.given == pytest.approx([60 * 2**0.5 / 137, 60 / 137 - 0.5, 70 / 137 - 0.5])
    resized = np.array(Image.fromarray(pixels).resize((size, size), Image.Resampling.BILINEAR))
    resized[resized[..., 3] == 0] = 0
    found = cutout.crop(cutout.given, size).astype(int)
    assert np.abs(found - resized)[..., 3].max() <= 2
    assert np.abs(found[20 * size // 64, 20 * size // 64] - [200, 100, 50, 255]).max() <= 1


@pytest.mark.parametrize(
    ("height", "rows", "columns"),
    [
        (100, (20, 60), (30, 90)),  # not square
        (137, (0, 60), (30, 90)),  # touches the side
        (137, (60, 70), (60, 70)),  # far away
        (137, (70, 130), (70, 130)),  # in a corner
    ],
)
def test_any_other_picture_is_framed(height, rows, columns):
    pixels = np.zeros((height, 137, 4), np.uint8)
    pixels[slice(*rows), slice(*columns), 3] = 255
    assert framing.Cutout(pixels).given is None
