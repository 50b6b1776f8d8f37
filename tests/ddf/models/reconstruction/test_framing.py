"""One object in many pictures is one shape: on a table, in a corner, turned by EXIF, as its own cut-out."""

import numpy as np
import pytest
from PIL import Image

from ddf.core import shipped_models
from ddf.data import cutouts
from ddf.models.reconstruction import one_image, trained


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
    Image.alpha_composite(Image.new("RGBA", corner.size, (60, 110, 160, 255)), corner).convert("RGB").save(
        folder / "corner.png"
    )


@pytest.mark.parametrize(("number", "another"), [(0, 1), (1, 2)])
def test_every_picture_of_a_chair_gives_its_shape(tmp_path, number, another):
    folder = shipped_models.place("chair")
    model, size = one_image.load(folder)
    known = trained.known(folder)
    _pictures(tmp_path, Image.open(folder / f"sample_{number}.png").resize((411, 411)))

    def latent(path):
        return one_image.latent(model, size, cutouts.read(path), known)

    own = latent(tmp_path / "cut.png")
    for name in ("table.jpg", "corner.png", "turned.jpg"):
        assert float((latent(tmp_path / name) - own).norm() / own.norm()) < 0.15
    assert float((latent(folder / f"sample_{another}.png") - own).norm() / own.norm()) > 0.5
