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
from ddf.export import viewer_fields

BUILT = Path(__file__).resolve().parent / "viewer"  # what `viewer/build.mjs` writes
_TEMPLATE = "page.html"


@dataclass(frozen=True)
class Page:
    """What a page shows.

    about: one sentence below the title. corners: of the box that cameras are about, frame of the page, as
    `Queried.corners`. up: the axis that points up. box: of a scene, what lies before it is cut away.
    """

    title: str
    about: str
    corners: Float[np.ndarray, "8 3"]
    fields: list[viewer_fields.BakedField]
    up: str = "y"
    box: tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]] | None = None


def render(page: Page) -> bytes:
    """The page as a file.

    Raises:
      InputError: there is no field.
    """
    records, numbers = viewer_fields.together(page.fields)
    record = {
        "title": page.title,
        "about": page.about,
        "up": page.up,
        "corners": page.corners.tolist(),
        "fields": records,
        "box": None if page.box is None else [corner.tolist() for corner in page.box],
    }
    return _filled({"title": html.escape(page.title), "page": _script(record), "weights": block(numbers.tobytes())})


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
    """The template with its marks `{{name}}` replaced; a mark without a part becomes empty."""
    template = (BUILT / _TEMPLATE).read_text(encoding="utf-8")
    pieces = template.split("{{")
    filled = [pieces[0]]
    for piece in pieces[1:]:
        name, end, rest = piece.partition("}}")
        filled.append(parts[name] + rest if end and name in parts else "{{" + piece)
    return "".join(filled).encode("utf-8")
