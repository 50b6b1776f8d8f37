"""Strips of pictures, like the paper's figure, and sheets of small images. Pixels only, no axes.

A strip shows input, visibility, depth, normals, clouds and truth. An example has a line of text, then its cells,
`PER_LINE` beside each other, so that a phone shows them at a good size. Every cell is a square RGB image (uint8) on
white; of an example's cells that part is shown, the same of all, that holds what is not white. Clouds are drawn as
small discs, nearest on top, from a camera of the benchmark frame; their colours are 3D coordinates within the box of
the truth, darker with distance. The typeface is that of the charts where matplotlib is installed, else Pillow's own.
"""

import functools
import importlib.util
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Int
from PIL import Image, ImageDraw, ImageFont

from ddf.geometry import cameras
from ddf.pictures import field_pictures


@functools.cache
def font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """DejaVu Sans of that size in pixels, without importing matplotlib."""
    charts = importlib.util.find_spec("matplotlib")
    if charts is None or charts.origin is None:
        return ImageFont.load_default(size)
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(charts.origin).parent / "mpl-data" / "fonts" / "ttf" / name), size)


CELL = 168  # pixels of a cell's side
_OVERSAMPLING = 3  # discs are drawn this much larger and averaged down
_DISC_RADIUS = 0.9  # of a point, in pixels of the 137-pixel camera
PER_LINE = 4  # cells beside each other
GAP, TEXT, NAME = 6, 54, 26  # pixels between cells, of an example's text, of the names above its cells
_FAINTEST, _MARGIN = 235, 0.04  # darker than this is shown, with this share of the side around it
_INK, _FAINT = (32, 36, 44), (110, 116, 128)
_QUALITY = 90  # of WebP: no difference to be seen, a quarter of the size of a PNG

Picture = field_pictures.Picture


@dataclass(frozen=True)
class StripRow:
    """One example: a heading, what is said of it below, and one picture per column (None leaves the cell empty)."""

    heading: str
    lines: Sequence[str]
    cells: Sequence[Picture | None]


def on_white(rgba: Float[np.ndarray, "size size 4"]) -> Picture:
    """A straight-alpha RGBA image in [0, 1] over white."""
    rgb, alpha = rgba[..., :3], rgba[..., 3:]
    return field_pictures.to_bytes(rgb * alpha + (1.0 - alpha))


def coordinate_colours(
    points: Float[np.ndarray, "n 3"], reference: Float[np.ndarray, "m 3"]
) -> Float[np.ndarray, "n 3"]:
    """RGB = position within the box of `reference`, clipped, kept away from white and black."""
    lower, upper = reference.min(axis=0), reference.max(axis=0)
    return 0.08 + 0.84 * np.clip((points - lower) / np.maximum(upper - lower, 1e-9), 0.0, 1.0)


def cloud_picture(
    points: Float[np.ndarray, "n 3"],
    colours: Float[np.ndarray, "n 3"],
    camera: Float[np.ndarray, "3"],
    size: int = CELL,
) -> Picture:
    """Points of the benchmark frame seen from a camera (azimuth_rad, elevation_rad, radius), as shaded discs."""
    extrinsics = cameras.extrinsics(*torch.from_numpy(np.asarray(camera, dtype=np.float64)))
    cloud = torch.from_numpy(np.asarray(points, dtype=np.float64))
    z_depth = -cameras.to_camera(cloud, *extrinsics)[..., 2].numpy()
    column, row = (value.numpy() for value in cameras.project(cloud, *extrinsics))
    front = z_depth > 1e-6
    order = np.flatnonzero(front)[np.argsort(-z_depth[front], kind="stable")]  # far first: the nearest is written last
    side = size * _OVERSAMPLING
    scale = side / cameras.IMAGE_SIZE
    offsets = _disc(_DISC_RADIUS * scale)
    place = np.stack([row, column], axis=-1)[order] * scale
    pixel = (np.floor(place).astype(np.int64)[:, None] + offsets[None]).reshape(-1, 2)
    shaded = (colours[order] * _shade(z_depth[order])[:, None]).repeat(len(offsets), axis=0)
    inside = ((pixel >= 0) & (pixel < side)).all(axis=1)
    canvas = np.ones((side, side, 3))
    canvas[pixel[inside, 0], pixel[inside, 1]] = shaded[inside]
    return field_pictures.to_bytes(canvas.reshape(size, _OVERSAMPLING, size, _OVERSAMPLING, 3).mean(axis=(1, 3)))


def _disc(radius: float) -> Int[np.ndarray, "k 2"]:
    reach = int(np.ceil(radius))
    offsets = np.stack(tuple(np.mgrid[-reach : reach + 1, -reach : reach + 1]), axis=-1).reshape(-1, 2)
    return offsets[(offsets**2).sum(axis=1) <= radius**2]


def _shade(z_depth: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """1 for the nearest, 0.68 for the farthest point: tells front from back."""
    near, far = (z_depth.min(), z_depth.max()) if len(z_depth) else (0.0, 1.0)
    return 1.0 - 0.32 * (z_depth - near) / max(far - near, 1e-12)


def strip(columns: Sequence[str], rows: Sequence[StripRow], per_line: int = PER_LINE, side: int = CELL) -> bytes:
    """The examples one below the other, as WebP; the column's name stands above every cell of `side` pixels."""
    lines = -(-len(columns) // per_line)
    line_height = NAME + side + GAP
    row_height = TEXT + lines * line_height
    width = min(len(columns), per_line) * (side + GAP) - GAP
    canvas = Image.new("RGB", (width, len(rows) * row_height), "white")
    draw = ImageDraw.Draw(canvas)
    for j, row in enumerate(rows):
        top, shown = j * row_height, _shown([cell for cell in row.cells if cell is not None])
        if j:
            draw.line([(0, top), (width, top)], fill=(200, 204, 210))
        draw.text((4, top + 16), row.heading, fill=_INK, font=font(19, bold=True), anchor="lm")
        draw.text((4, top + 40), "; ".join(row.lines), fill=_FAINT, font=font(17), anchor="lm")
        for i, (name, cell) in enumerate(zip(columns, row.cells, strict=True)):
            left, above = (i % per_line) * (side + GAP), top + TEXT + (i // per_line) * line_height
            if cell is not None:
                middle = (left + side / 2, above + NAME / 2)
                draw.text(middle, name, fill=_INK, font=font(17), anchor="mm")
                left_edge, upper, right, lower = (len(cell) * edge for edge in shown)
                picture = Image.fromarray(cell).resize(
                    (side, side), Image.Resampling.BILINEAR, (left_edge, upper, right, lower)
                )
                canvas.paste(picture, (left, above + NAME))
    return webp_bytes(canvas)


def _shown(cells: Sequence[Picture]) -> tuple[float, float, float, float]:
    """Left, top, right and lower edge of the least square that holds what is not white, in shares of a cell's side."""
    ink = [np.argwhere((cell < _FAINTEST).any(-1)) / len(cell) for cell in cells]
    found = np.concatenate([np.zeros((0, 2)), *ink])
    if not len(found):
        return 0.0, 0.0, 1.0, 1.0
    low, high = found.min(0) - _MARGIN, found.max(0) + _MARGIN
    side = min(float((high - low).max()), 1.0)
    top, left = np.clip((low + high - side) / 2, 0.0, 1.0 - side).tolist()
    return left, top, left + side, top + side


def webp_bytes(image: Image.Image) -> bytes:
    """An RGB image as WebP; the same bytes for the same pixels."""
    buffer = io.BytesIO()
    image.save(buffer, "WEBP", quality=_QUALITY, method=6, use_sharp_yuv=True)
    return buffer.getvalue()


def contact_sheet(named: Sequence[tuple[str, Sequence[Picture]]]) -> bytes:
    """Two pictures of each of many things, the end of its name below them, as WebP."""
    side = len(named[0][1][0])
    columns = max(5, -(-len(named) * (side + _SHEET_NAME) // 16_000))  # a WebP has 16,383 lines at most
    canvas = Image.new("RGB", (columns * 2 * side, -(-len(named) // columns) * (side + _SHEET_NAME)), "white")
    pen = ImageDraw.Draw(canvas)
    for number, (name, pictures) in enumerate(named):
        left, top = number % columns * 2 * side, number // columns * (side + _SHEET_NAME)
        canvas.paste(Image.fromarray(np.concatenate(pictures, axis=1)), (left, top))
        pen.text((left + side, top + side + 8), name[-36:], fill=_INK, font=font(12), anchor="mm")
    return webp_bytes(canvas)


SHEET_CELL = 96  # pixels of the side of an image of a sheet
_SHEET_GAP, _SHEET_NAME = 4, 24

Images = Float[np.ndarray, "_ 3 _ _"]  # rows differ in number
Row = tuple[str, Images]


def sheet(rows: Sequence[Row], cell: int = SHEET_CELL) -> bytes:
    """A sheet of small images as WebP; images in [0, 1], `cell` pixels a side; a row may have fewer than another."""
    columns = max(len(images) for _, images in rows)
    tops = np.cumsum([0, *((_SHEET_NAME if name else 0) + cell + _SHEET_GAP for name, _ in rows)]).tolist()
    canvas = Image.new("RGB", (columns * (cell + _SHEET_GAP) - _SHEET_GAP, tops[-1]), "white")
    pen = ImageDraw.Draw(canvas)
    for top, below, (name, images) in zip(tops, tops[1:], rows, strict=False):
        pen.text((2, top + _SHEET_NAME / 2), name, fill=_INK, font=font(15), anchor="lm")
        for column, image in enumerate(images):
            picture = Image.fromarray(field_pictures.to_bytes(image.transpose(1, 2, 0)))
            place = (column * (cell + _SHEET_GAP), below - _SHEET_GAP - cell)
            canvas.paste(picture.resize((cell, cell), Image.Resampling.BILINEAR), place)
    return webp_bytes(canvas)
