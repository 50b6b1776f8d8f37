"""The typeface of words in pictures: that of the charts where matplotlib is installed, else Pillow's own."""

import functools
import importlib.util
from pathlib import Path

from PIL import ImageFont


@functools.cache
def font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """DejaVu Sans of that size in pixels, without importing matplotlib."""
    charts = importlib.util.find_spec("matplotlib")
    if charts is None or charts.origin is None:
        return ImageFont.load_default(size)
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(charts.origin).parent / "mpl-data" / "fonts" / "ttf" / name), size)
