"""Pictures beside each other, named above, in letters that a phone shows as well: for the scripts of this folder."""

from collections.abc import Sequence

from PIL import Image, ImageDraw

from ddf.pictures import picture_strips

GAP, SHARE, LINE = 6, 0.023, 1.5  # pixels; the letters' size by the sheet's width; a line by them


def sheet(rows: Sequence[tuple[str, Sequence[str], Sequence[Image.Image]]]) -> Image.Image:
    """Rows of a heading, perhaps empty, names, perhaps none, and pictures of one size; a name may have two lines."""
    cell, across = rows[0][2][0], max(len(pictures) for _, _, pictures in rows)
    width = across * (cell.width + GAP) - GAP
    letters = picture_strips.font(round(SHARE * width))
    step = round(SHARE * LINE * width)
    lines = [(heading != "") + max((name.count("\n") + 1 for name in names), default=0) for heading, names, _ in rows]
    whole = Image.new("RGB", (width, sum(each * step + cell.height + GAP for each in lines)), "white")
    pen, top = ImageDraw.Draw(whole), 0
    for (heading, names, pictures), count in zip(rows, lines, strict=True):
        pen.text((GAP, top + step / 2), heading, fill="black", font=letters, anchor="lm")
        top += count * step
        for column, picture in enumerate(pictures):
            left = column * (cell.width + GAP)
            whole.paste(picture, (left, top))
            for line, text in enumerate(reversed(names[column].split("\n") if names else ())):
                middle = (left + cell.width / 2, top - (line + 0.5) * step)
                pen.text(middle, text, fill="black", font=letters, anchor="mm")
        top += cell.height + GAP
    return whole
