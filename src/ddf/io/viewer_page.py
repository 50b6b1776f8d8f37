"""The page that renders fields live: one HTML file that needs nothing but itself and a browser.

The page is a template, built from the sources in `viewer/` and committed; here the data goes in. Blocks are gzip in
base64. The page's own policy forbids it every request, so that nothing leaves the machine.
"""

import base64
import gzip
import html
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from ddf.core import storage
from ddf.io import viewer_fields

BUILT = Path(__file__).resolve().parent / "viewer"  # what `viewer/build.mjs` writes
_TEMPLATE, _WASM, _RUNTIME = "page.html", "wasm.js", "ort.wasm.gz"  # the last two for pages of models

_MARKS = ("title", "page", "weights", "model", "runtime", "wasm", "first")  # of the template


@dataclass(frozen=True)
class Encoders:
    """What a page needs to rebuild the field of an image.

    onnx: `onnx_graphs.ModulationsGraph`. image_size: pixels a side that it takes. samples: PNG files to choose from;
    the page begins with the first. radius: of training cameras, the mean, benchmark units. usual: whether the file
    tells how usual an image is.
    """

    onnx: bytes
    image_size: int
    samples: list[bytes]
    radius: float
    usual: bool


@dataclass(frozen=True)
class Page:
    """What a page shows.

    about: one sentence below the title. corners: of the box that cameras are about, frame of the page, as
    `Queried.corners`. up: the axis that points up. box: of a scene, what lies before it is cut away.
    encoders: of a model, whose one field is that of an image and has no modulations yet. first: WebP of
    `viewer_picture`, which is seen until the page has drawn its own.
    """

    title: str
    about: str
    corners: Float[np.ndarray, "8 3"]
    fields: list[viewer_fields.BakedField]
    up: str = "y"
    box: tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]] | None = None
    encoders: Encoders | None = None
    azimuth: float = 35.0
    first: bytes = b""


def render(page: Page) -> bytes:
    """The page as a file.

    Raises:
      InputError: there is no field.
    """
    records, numbers = viewer_fields.together(page.fields)
    record: dict[str, Any] = {
        "title": page.title,
        "about": page.about,
        "up": page.up,
        "azimuth": page.azimuth,
        "corners": page.corners.tolist(),
        "fields": records,
        "model": None,
        "box": None if page.box is None else [corner.tolist() for corner in page.box],
    }
    parts = {"title": html.escape(page.title), "weights": block(numbers.tobytes())}
    if page.encoders is not None:
        samples = ["data:image/png;base64," + base64.b64encode(sample).decode() for sample in page.encoders.samples]
        own = {name: getattr(page.encoders, name) for name in ("image_size", "radius", "usual")}
        record["model"] = own | {"samples": samples}
        parts["model"] = block(page.encoders.onnx)
        parts["runtime"] = base64.b64encode((BUILT / _RUNTIME).read_bytes()).decode()
        parts["wasm"] = (BUILT / _WASM).read_text(encoding="utf-8")
    if page.first:
        source = "data:image/webp;base64," + base64.b64encode(page.first).decode()
        parts["first"] = f'<img id="first" alt="" src="{source}">'
    return _filled(parts | {"page": _script(record)})


def write(path: Path, page: Page) -> int:
    """The page under its name; returns its size in bytes."""
    data = render(page)
    storage.write_bytes(path, data)
    return len(data)


def block(data: bytes) -> str:
    """Bytes as the page reads them."""
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()


def _script(record: Mapping[str, Any]) -> str:
    """JSON inside a script element, which nothing in it can end."""
    return json.dumps(record, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _filled(parts: Mapping[str, str]) -> bytes:
    """The template with its marks `{{name}}` replaced; one without a part becomes empty."""
    template = (BUILT / _TEMPLATE).read_text(encoding="utf-8")
    pieces = template.split("{{")
    filled = [pieces[0]]
    for piece in pieces[1:]:
        name, end, rest = piece.partition("}}")
        filled.append(parts.get(name, "") + rest if end and name in _MARKS else "{{" + piece)
    return "".join(filled).encode("utf-8")
