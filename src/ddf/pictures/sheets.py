"""Sheets of small images: one row below the other, each with its name, if it has one."""

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


def sheet(rows: Sequence[Row], cell: int = CELL) -> bytes:
    """The rows as one WebP; images in [0, 1], `cell` pixels a side; a row may have fewer than another."""
    columns = max(len(images) for _, images in rows)
    tops = np.cumsum([0, *((_NAME if name else 0) + cell + _GAP for name, _ in rows)]).tolist()
    canvas = Image.new("RGB", (columns * (cell + _GAP) - _GAP, tops[-1]), "white")
    pen = ImageDraw.Draw(canvas)
    for top, below, (name, images) in zip(tops, tops[1:], rows, strict=False):
        pen.text((2, top + _NAME / 2), name, fill=_INK, font=typeface.font(15), anchor="lm")
        for column, image in enumerate(images):
            picture = Image.fromarray(field_pictures.to_bytes(image.transpose(1, 2, 0)))
            place = (column * (cell + _GAP), below - _GAP - cell)
            canvas.paste(picture.resize((cell, cell), Image.Resampling.BILINEAR), place)
    return picture_strips.webp_bytes(canvas)
