"""A command's result as one JSON object for scripts, or as a short table with a verdict for people; images as files.

What is not known, the mean of nothing say, is NaN in Python, null in JSON and "–" in the table.
"""

import io
import json
import logging
import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float, UInt8

FOR_PEOPLE = ("table", "verdict", "doubtful")  # keys of a result that JSON leaves out
NOTHING = "–"
_LONG = 8  # items of a list from which on only their number is shown
PICTURES = {".png": "PNG", ".webp": "WEBP"}
ARRAYS = (".npz", ".exr")
_LEVELS = 65535  # of 16 bits, beside 0
_AXES = "XYZ"
_WIDTH = 100  # of lines


def json_line(result: Mapping[str, Any]) -> str:
    """The result on one line; NaN and infinity, which JSON lacks, are null."""
    plain = {key: value for key, value in result.items() if key not in FOR_PEOPLE}
    return json.dumps(_jsonable(plain), allow_nan=False) + "\n"


def text(result: Mapping[str, Any]) -> str:
    """The table, of what the result holds where it has none, and the verdict."""
    shown = result.get("table", {key: value for key, value in result.items() if key not in FOR_PEOPLE})
    lines = list(shown) if isinstance(shown, list) else _lines(shown)
    return "\n".join([*lines, *([result["verdict"]] if "verdict" in result else [])]) + "\n"


def show_parts() -> None:
    """Show what the package logs of its parts on stderr, a line each."""
    logging.basicConfig(format="%(message)s")
    logging.getLogger("ddf").setLevel(logging.INFO)


def grid(header: Sequence[str], rows: Sequence[Sequence[Any]]) -> list[str]:
    """Lines of a table with a header; columns of numbers are set right."""
    if not rows:
        return []
    cells = [[cell(value) for value in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(header, *cells, strict=True)]
    right = [all(_is_number(row[i]) for row in rows) for i in range(len(header))]
    lines = [
        "  ".join(f"{word:>{width}}" if is_right else f"{word:<{width}}" for word, width, is_right in columns).rstrip()
        for columns in (list(zip(row, widths, right, strict=True)) for row in (list(header), *cells))
    ]
    return [part for line in lines for part in folded(line, sum(widths[:-1]) + 2 * len(widths) - 2)]


def folded(text: str, indent: int = 2) -> list[str]:
    """Lines of at most 100 characters, further ones indented, by the place of a table's last column say."""
    return textwrap.wrap(text, _WIDTH, subsequent_indent=" " * min(indent, _WIDTH // 2), break_long_words=False)


def cell(value: Any) -> str:
    """One value as people read it: 4,812 and 0.01234, yes and no, "–" for what is not known."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return NOTHING
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}"
    if isinstance(value, float):
        return f"{value:.4g}" if abs(value) < 1e4 or math.isinf(value) else f"{value:,.0f}"
    if isinstance(value, list | tuple):
        words = [cell(item) for item in value]
        return (f"{len(words):,} in all" if len(words) > _LONG else ", ".join(words)) or "none"
    return str(value)


def left_out(remarks: Sequence[str]) -> str:
    """The end of a verdict on a mesh: what its reader left out; nothing where it took all."""
    return f"; of the file: {'; '.join(remarks)}" if remarks else ""


def other_units(
    what: str, points: "Float[np.ndarray, 'n 3']", own: str, corners: "Float[np.ndarray, 'm 3']", factor: float = 100.0
) -> str:
    """The end of a verdict where the box of points is so many times that of others, or less; else nothing."""
    import numpy as np

    size, of = (float(np.linalg.norm(np.ptp(each, axis=0))) if len(each) else 0.0 for each in (points, corners))
    far = min(size, of) > 0 and not 1 / factor < size / of < factor
    return f"; the {what} box is {size / of:,.4g} times the {own}: are its units others?" if far else ""


def _lines(result: Mapping[str, Any]) -> list[str]:
    pairs = list(_flat(result))
    width = max((len(name) for name, _ in pairs), default=0)
    return [f"{name:<{width}}  {cell(value)}" for name, value in pairs]


def _flat(result: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in result.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _is_number(value: Any) -> bool:
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool))


def _jsonable(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _jsonable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_jsonable(item) for item in value]
    if hasattr(value, "tolist"):
        return _jsonable(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def encode(frames: "Sequence[UInt8[np.ndarray, 'height width 3']]", suffix: str, frame_ms: int = 0) -> bytes:
    """Pictures as one file of the `PICTURES`, moving and looping where there are several; every pixel is kept."""
    from PIL import Image

    buffer = io.BytesIO()
    first, *others = (Image.fromarray(frame) for frame in frames)
    more: dict[str, Any] = {"lossless": True} if suffix == ".webp" else {}
    if others:
        more |= {"save_all": True, "append_images": others, "duration": frame_ms, "loop": 0}
    first.save(buffer, format=PICTURES[suffix], **more)
    return buffer.getvalue()


def depth_png(depth: "Float[np.ndarray, 'height width']") -> tuple[bytes, float]:
    """Depth as a PNG of 16 bits, and its step: depth = value x step, and 0 where nothing is seen.

    The step is the largest depth over 65,535; the file says it too, as its text `depth_step`, and that depth is along
    the rays, as `scans` reads it.
    """
    import numpy as np
    from PIL import Image, PngImagePlugin

    seen = np.isfinite(depth)
    step = float(depth[seen].max() / _LEVELS if seen.any() else 0.0) or 1.0
    levels = np.where(seen, np.rint(np.where(seen, depth, 0.0) / step).clip(1), 0.0)
    note = PngImagePlugin.PngInfo()
    note.add_text("depth_step", repr(step))
    note.add_text("depth_along", "the ray through each pixel, not the optical axis")
    buffer = io.BytesIO()
    Image.fromarray(levels.astype(np.uint16)).save(buffer, format="PNG", pnginfo=note)
    return buffer.getvalue(), step


def npz(arrays: "Mapping[str, np.ndarray]") -> bytes:
    """Named arrays as they are."""
    import numpy as np

    buffer = io.BytesIO()
    np.savez(buffer, **cast("Any", arrays))
    return buffer.getvalue()


def write_exr(path: Path, images: "Mapping[str, Float[np.ndarray, 'height width ...']]") -> None:
    """Images as float32 channels of one OpenEXR file: `depth`, `normals.X`, `normals.Y`, ..."""
    import numpy as np
    import OpenEXR

    from ddf.core import storage

    channels = {}
    for name, values in images.items():
        planes = {name: values} if values.ndim == 2 else {f"{name}.{a}": values[..., i] for i, a in enumerate(_AXES)}
        channels |= {key: np.ascontiguousarray(plane, dtype=np.float32) for key, plane in planes.items()}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with storage.atomic_path(path) as temporary, OpenEXR.File(header, channels) as file:
        file.write(str(temporary))
