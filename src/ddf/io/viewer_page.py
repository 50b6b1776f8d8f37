"""The page that renders fields live: one HTML file that needs nothing but itself and a browser.

The page is a template, built from the sources in `viewer/` and committed; here the data goes in: patches as in their
file, sine networks with ω in their weights. The page's own policy forbids it every request, so that nothing leaves the
machine. The first picture is drawn here, shaded like `viewer/src/shading.ts`. Nothing here asks for torch.
"""

import base64
import gzip
import html
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, Float32
from PIL import Image

from ddf.core import checks, storage
from ddf.fields import field_file, framed_field
from ddf.geometry import cameras, transforms

if TYPE_CHECKING:
    from ddf.fields.grid import patch_field

    Shape = field_file.FieldFile | patch_field.PatchField

ABOUT = "A directed distance field, evaluated live by this page: visibility and depth along every ray."
ABOUT_SCENE = "Directed distance fields in one scene, evaluated live by this page; each ray shows the nearest surface."
ABOUT_ROW = "Directed distance fields side by side, evaluated live by this page; all are as large as the first."
GAP = 0.05  # between two of a row, of their longest side
_ROW_AZIMUTH = 15.0  # degrees; at 0 a row is seen from its front, and so are shapes that look along x
_RIGHT = {"y": (2, -1.0), "z": (1, 1.0)}  # axis and sign from left to right there, by the axis that points up
_PATCHES = ("codes", "planes", "bends", "cells")  # arrays of patches in the order of their bytes


@dataclass(frozen=True)
class BakedField:
    """A field for the page.

    record: JSON, as `FieldRecord` of the page's sources; `offset` is where its numbers begin. numbers: weights, row by
    row, and biases, layer after layer, the head last; of patches the bytes of their arrays.
    """

    record: dict[str, Any]
    numbers: Float32[np.ndarray, "n"]


def field(path: Path) -> "Shape":
    """A field for a page, by its folder or file."""
    if path.suffix == ".onnx":
        raise checks.InputError(f"{path}: a page takes a field's weights; give the folder that `ddf fit` wrote")
    file = field_file.file_of(path)
    if not file.is_file() or storage.load_metadata(file).get("kind") != field_file.PATCHES:
        return field_file.read(path)
    from ddf.fields.grid import patch_field

    return patch_field.load(file)


def name_of(path: Path) -> str:
    """What a field is called: its folder."""
    return path.resolve().name if path.is_dir() else path.resolve().parent.name


def bake(shape: "Shape", name: str) -> BakedField:
    """A field for a page in the frame of its mesh (see `placed`)."""
    record = {
        "name": name,
        "offset": 0,
        "lower": shape.lower.tolist(),
        "upper": shape.upper.tolist(),
        "field_from_mesh": shape.field_from_mesh.to_dict(),
        "world_from_mesh": transforms.Similarity().to_dict(),
    }
    if not isinstance(shape, field_file.FieldFile):
        arrays = [shape.arrays[part] for part in _PATCHES]
        data = b"".join(each.astype(each.dtype.newbyteorder("<")).tobytes() for each in arrays)
        counts = {part: len(shape.arrays[part]) for part in ("codes", "bends", "cells")}
        record |= {"kind": "patches", "tolerance": shape.tolerance, **counts}
        return BakedField(record, np.frombuffer(data + bytes(-len(data) % 4), np.float32))
    layers = shape.layers()
    parts = [omega * part.astype(np.float64).reshape(-1) for *both, omega in layers for part in both]
    record |= {
        "kind": "sine",
        "widths": [layers[0][0].shape[1], *(len(bias) for _, bias, _ in layers)],
        "depth_activation": shape.config["depth_activation"],
        "depth_sharpness": shape.config["depth_sharpness"],
    }
    return BakedField(record, np.concatenate(parts).astype(np.float32))


def placed(field: BakedField, world_from_mesh: transforms.Similarity, name: str | None = None) -> BakedField:
    """The same field elsewhere, under another name where one is given."""
    changed = {"world_from_mesh": world_from_mesh.to_dict(), "name": name or field.record["name"]}
    return BakedField(field.record | changed, field.numbers)


def together(fields: list[BakedField]) -> tuple[list[dict[str, Any]], Float32[np.ndarray, "n"]]:
    """Records and numbers of several fields, as one block; numbers that fields share are there once."""
    offsets: dict[int, int] = {}
    numbers, total = [], 0
    for field in fields:
        if id(field.numbers) not in offsets:
            offsets[id(field.numbers)] = total
            numbers.append(field.numbers)
            total += len(field.numbers)
    return [field.record | {"offset": offsets[id(field.numbers)]} for field in fields], np.concatenate(numbers)


TEMPLATE = Path(__file__).resolve().parent / "viewer" / "page.html"  # what `viewer/build.mjs` writes
_MARKS = ("title", "page", "weights", "first")  # of the template


@dataclass(frozen=True)
class Page:
    """What a page shows.

    about: one sentence below the title. corners: of the box that cameras are about, frame of the page, as
    `Queried.corners`. up: the axis that points up. box: of a scene, what lies before it is cut away. azimuth: of the
    first picture, degrees. first: WebP of `first`, which is seen until the page has drawn its own.
    """

    title: str
    about: str
    corners: Float[np.ndarray, "8 3"]
    fields: list[BakedField]
    up: str = "y"
    box: tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]] | None = None
    azimuth: float = 35.0
    first: bytes = b""


def corners(shape: "Shape") -> Float[np.ndarray, "8 3"]:
    """Those of a field's box, in the frame of its mesh."""
    return shape.field_from_mesh.inverse().apply(transforms.box_corners(shape.lower, shape.upper))


def field_page(shape: "Shape", name: str, up: str = "y", about: str = ABOUT) -> Page:
    """The page of one field, in the frame of its mesh."""
    return Page(name, about, corners(shape), [bake(shape, name)], up)


def scene_page(
    name: str,
    fields: Sequence[BakedField],
    lower: Float[np.ndarray, "3"],
    upper: Float[np.ndarray, "3"],
    up: str = "y",
    cut: bool = False,
) -> Page:
    """The page of several fields, and the box that cameras are about, frame of the scene; what lies before it is cut
    away if `cut`.
    """
    box = (lower, upper) if cut else None
    return Page(name, ABOUT_SCENE, transforms.box_corners(lower, upper), list(fields), up, box)


def side_by_side(title: str, shapes: "Sequence[tuple[str, Shape]]", up: str = "y") -> Page:
    """The page of fields in a row from left to right, seen from +x: along -z, or along y where z points up.

    Longest sides of their boxes are made equal to that of the first; the boxes stand on one floor, in the unit of the
    first. A field that stands there several times, under any name, is in the page once.
    """
    boxes = [corners(shape) for _, shape in shapes]
    baked = {id(shape): bake(shape, name) for name, shape in shapes}
    side = float(np.ptp(boxes[0], axis=0).max())
    fields, reach, lower, upper = [], 0.0, np.full(3, np.inf), np.full(3, -np.inf)
    for (name, shape), box in zip(shapes, boxes, strict=True):
        place = _beside(box, side, reach, up)
        stands = place.apply(box)
        axis, sign = _RIGHT[up]
        reach = float((sign * stands[:, axis]).max()) + GAP * side
        lower, upper = np.minimum(lower, stands.min(axis=0)), np.maximum(upper, stands.max(axis=0))
        fields.append(placed(baked[id(shape)], place, name))
    return Page(title, ABOUT_ROW, transforms.box_corners(lower, upper), fields, up, azimuth=_ROW_AZIMUTH)


def _beside(box: Float[np.ndarray, "8 3"], side: float, reach: float, up: str) -> transforms.Similarity:
    """What takes a box to the right of `reach`, onto the floor, its middle to x = 0."""
    lower, upper = box.min(axis=0), box.max(axis=0)
    scale, (axis, sign) = side / float((upper - lower).max()), _RIGHT[up]
    at = -scale * lower
    at[0] = -scale * (lower[0] + upper[0]) / 2
    at[axis] = sign * reach - scale * (lower if sign > 0 else upper)[axis]
    return transforms.Similarity(scale, np.eye(3), at)


def render(page: Page) -> bytes:
    """The page as a file: the template with its marks `{{name}}` replaced."""
    records, numbers = together(page.fields)
    record: dict[str, Any] = {
        "title": page.title,
        "about": page.about,
        "up": page.up,
        "azimuth": page.azimuth,
        "corners": page.corners.tolist(),
        "fields": records,
        "box": None if page.box is None else [corner.tolist() for corner in page.box],
    }
    packed = base64.b64encode(gzip.compress(numbers.tobytes(), 9, mtime=0)).decode()
    text = json.dumps(record, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")  # which ends no element
    parts = {"title": html.escape(page.title), "weights": packed, "page": text}
    if page.first:
        source = "data:image/webp;base64," + base64.b64encode(page.first).decode()
        parts["first"] = f'<img id="first" alt="" src="{source}">'
    pieces = TEMPLATE.read_text(encoding="utf-8").split("{{")
    filled = [pieces[0]]
    for piece in pieces[1:]:
        name, end, rest = piece.partition("}}")
        filled.append(parts.get(name, "") + rest if end and name in _MARKS else "{{" + piece)
    return "".join(filled).encode("utf-8")


def write(path: Path, page: Page) -> int:
    """The page under its name; returns its size in bytes."""
    data = render(page)
    storage.write_bytes(path, data)
    return len(data)


ELEVATION = 25.0  # of the page's first camera, degrees
_SIZE = 384  # pixels a side
_DARK, _CLAY = np.array([24.0, 26.0, 32.0]), np.array([214.0, 201.0, 182.0])


def first(field: framed_field.FramedField, azimuth: float, up: str = "y") -> bytes:
    """Clay under a light at the camera, clear where nothing is seen, as WebP. The camera's azimuth is in degrees, its
    radius that from which the picture holds the box; the field has normals.
    """
    camera = (azimuth, ELEVATION, framed_field.framing_radius(field, azimuth, ELEVATION, up))
    found, _ = framed_field.render(field, camera, _SIZE, ("depth", "normals"), up)
    _, directions = framed_field.camera_rays(field, camera, _SIZE, up)
    looks = field.field_from_mesh.inverse().apply_directions(directions).reshape(_SIZE, _SIZE, 3)
    above = framed_field.upright(up) @ cameras.rotation(*np.deg2rad(np.array(camera[:2])))[1]
    towards, sky = -(found["normals"] * looks).sum(-1), found["normals"] @ above
    level = np.clip(0.18 + 0.7 * np.maximum(towards, 0) + 0.12 * (0.5 + 0.5 * sky), 0, 1)[..., None]
    seen = np.isfinite(found["depth"])[..., None]
    rgba = seen * np.concatenate([_DARK + level * (_CLAY - _DARK), np.full_like(level, 255.0)], axis=-1)
    buffer = io.BytesIO()
    Image.fromarray(np.rint(rgba).astype(np.uint8), "RGBA").save(buffer, "WEBP", quality=80, method=6)
    return buffer.getvalue()
