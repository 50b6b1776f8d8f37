"""Writes docs/ten.webp: the paper in ten pictures, all of shapes and models that come with the package.

Its metadata hold the checksums of the fields.
"""

import io
import json
from pathlib import Path

import numpy as np
from PIL import Image

import ddf
from ddf.core import shipped_models
from ddf.data.synthetic import showcase
from ddf.fields import checked_cloud, framed_field, scene_field, shape_field
from ddf.fit import patch_fitting
from ddf.pictures import field_pictures, picture_strips, shaded
from ddf_lab.engine import publish
from ddf_lab.figures import distance_figure, figure_fields, room_figure, slice_figures

SIDE, PER_LINE = 280, 5
CAMERA = (35.0, 22.0)  # azimuth and elevation, degrees
OUTPUTS = {"depth": "depth d", "normals": "normals from ∇d", "mean_curvature": "curvature from ∇²d"}
IMAGE = shipped_models.ROOT / "car" / "sample_1.png"
OUT = Path(__file__).with_suffix(".webp")


def lit(field: framed_field.FramedField, camera: tuple[float, float] = CAMERA, side: int = SIDE) -> np.ndarray:
    """Shaded, cut to what is seen."""
    whole = (*camera, framed_field.framing_radius(field, *camera))
    standing = shaded.stand(field)
    return shaded.render(standing, whole, side, shaded.window(standing, [whole])).picture


def reconstructed() -> np.ndarray:
    """An image, smaller, before the field that the car model makes of it."""
    found = ddf.reconstruct(IMAGE, "car")
    picture = lit(found.field.framed, (found.camera["azimuth_deg"], found.camera["elevation_deg"])).copy()
    given = Image.open(IMAGE).convert("RGBA").resize((SIDE // 3, SIDE // 3))
    picture[: SIDE // 3, : SIDE // 3] = picture_strips.on_white(np.asarray(given) / 255.0)
    return picture


def pictures() -> dict[str, np.ndarray]:
    """By what stands above them."""
    rabbit, on_ground = shape_field.load(shipped_models.place("rabbit-network")), slice_figures.standing()
    images = framed_field.render(
        rabbit, (*CAMERA, framed_field.framing_radius(rabbit, *CAMERA)), SIDE, (*OUTPUTS, "visibility")
    )[0]
    nearest = distance_figure.exact("rabbit", showcase.SHAPES["rabbit"]())
    udf, _, ways, _ = distance_figure.slices(0.5, rabbit, nearest, checked_cloud.draw(rabbit), SIDE)
    parts = (patch_fitting.patches(figure_fields.SHAPES["room"]()), patch_fitting.patches(showcase.SHAPES["rabbit"]()))
    look = scene_field.fly(room_figure.FLIGHT, room_figure.FRAMES)[2]
    return {
        "a field, lit by its rays": lit(patch_fitting.patches(showcase.SHAPES["airliner"]())),
        "oriented points (p, v)": slice_figures.points(on_ground, SIDE),
        "d(p, v) for one v": slice_figures.slices(on_ground, rabbit, (0.0, 0.0, -1.0), SIDE),
        **{label: field_pictures.picture(name, images) for name, label in OUTPUTS.items()},
        "unsigned distance": udf,
        "v*, to the closest point": ways,
        "two fields, composed": room_figure.view(room_figure.composed(*parts), look, SIDE),
        "from one image": reconstructed(),
    }


def main() -> None:
    """Two lines of five."""
    found = pictures()
    row = picture_strips.StripRow("Directed distance fields", (), list(found.values()))
    sheet = Image.open(io.BytesIO(picture_strips.strip(list(found), [row], PER_LINE, SIDE)))
    sheet.save(OUT, quality=85, method=6, xmp=json.dumps(publish.shipped("field")).encode())


if __name__ == "__main__":
    main()
