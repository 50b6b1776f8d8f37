"""Sheets of small images: one row below the other, each with its name."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from PIL import Image, ImageDraw

from ddf.pictures import field_pictures, picture_strips, typeface

CELL = 96  # pixels of an image's side
_GAP, _NAME = 4, 24
_INK = (32, 36, 44)

Images = Float[np.ndarray, "_ 3 _ _"]  # rows differ in number
Row = tuple[str, Images]


def sheet(rows: Sequence[Row]) -> bytes:
    """The rows as one WebP; images in [0, 1], a row may have fewer than another."""
    columns = max(len(images) for _, images in rows)
    height, width = len(rows) * (_NAME + CELL + _GAP), columns * (CELL + _GAP) - _GAP
    canvas = Image.new("RGB", (width, height), "white")
    pen = ImageDraw.Draw(canvas)
    for number, (name, images) in enumerate(rows):
        top = number * (_NAME + CELL + _GAP)
        pen.text((2, top + _NAME / 2), name, fill=_INK, font=typeface.font(15), anchor="lm")
        for column, image in enumerate(images):
            picture = Image.fromarray(field_pictures.to_bytes(image.transpose(1, 2, 0)))
            place = (column * (CELL + _GAP), top + _NAME)
            canvas.paste(picture.resize((CELL, CELL), Image.Resampling.BILINEAR), place)
    return picture_strips.webp_bytes(canvas)
