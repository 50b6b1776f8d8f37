"""The page that renders fields live: one HTML file that needs nothing but itself and a browser.

The page is a template, built from the sources in `viewer/` and committed; here the data goes in. Blocks are gzip in
base64. The page's own policy forbids it every request, so that nothing leaves the machine.

Patches are in the page as in their file, sine networks with all factors in the weights. With
h_l = m_l sin(ω_l (W_l h_{l-1} + b_l)) of `siren`, the states sin(ω_l (W_l h_{l-1} + b_l)) are those of a network with
weights ω_l W_l diag(m_{l-1}) and biases ω_l b_l, whose head is W diag(m_L): derived here. So one shader draws fields of
one shape, reconstructions and samples. The first picture is drawn here, shaded like `viewer/src/shading.ts`.
"""

import base64
import gzip
import html
import io
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from jaxtyping import Float, Float32
from PIL import Image

from ddf.core import arrays, checks, storage
from ddf.fields import field_file, framed_field
from ddf.geometry import cameras, transforms

if TYPE_CHECKING:
    from ddf.fields import shape_field
    from ddf.fields.grid import patch_field


_PATCHES = ("codes", "planes", "bends", "cells")  # arrays of patches in the order of their bytes


@dataclass(frozen=True)
class BakedField:
    """A field for the page.

    record: JSON, as `FieldRecord` of the page's sources; `offset` is where its numbers begin. numbers: weights, row by
    row, and biases, layer after layer, the head last; of patches the bytes of their arrays.
    """

    record: dict[str, Any]
    numbers: Float32[np.ndarray, "n"]


def bake(shape: "field_file.FieldFile | shape_field.ShapeField | patch_field.PatchField", name: str) -> BakedField:
    """A field for a page in the frame of its mesh (see `placed`), by its file or as torch holds it.

    Raises:
      InputError: as `FieldFile.layers`.
    """
    place = {
        "name": name,
        "offset": 0,
        "lower": shape.lower.tolist(),
        "upper": shape.upper.tolist(),
        "field_from_mesh": shape.field_from_mesh.to_dict(),
        "world_from_mesh": transforms.Similarity().to_dict(),
    }
    if shape.record.get("kind") == field_file.PATCHES:
        return _patches(cast("patch_field.PatchField", shape), place)
    if isinstance(shape, field_file.FieldFile):
        layers, config, modulations = shape.layers(), shape.config, None
    else:
        shape = cast("shape_field.ShapeField", shape)
        network, config, modulations = shape.field.network, asdict(shape.field.config), shape.modulations
        parts = zip((*network.layers, network.head), (*network.omegas, 1.0), strict=True)
        layers = [(arrays.to_numpy(part.weight), arrays.to_numpy(part.bias), omega) for part, omega in parts]
    numbers = []
    for index, (weight, bias, omega) in enumerate(layers):
        weight = omega * weight.astype(np.float64)
        if modulations is not None and index:
            weight = weight * arrays.to_numpy(modulations[index - 1]).reshape(-1)
        numbers += [weight.reshape(-1), omega * bias.astype(np.float64)]
    record = {
        "kind": "sine",
        "widths": [layers[0][0].shape[1], *(len(bias) for _, bias, _ in layers)],
        "depth_activation": config["depth_activation"],
        "depth_sharpness": config["depth_sharpness"],
    }
    return BakedField(place | record, np.concatenate(numbers).astype(np.float32))


def _patches(shape: "patch_field.PatchField", place: dict[str, Any]) -> BakedField:
    """The arrays of the file as they are, little-endian."""
    data = b"".join(
        shape.arrays[name].astype(shape.arrays[name].dtype.newbyteorder("<")).tobytes() for name in _PATCHES
    )
    counts = {name: len(shape.arrays[name]) for name in ("codes", "bends", "cells")}
    record = {"kind": "patches", "tolerance": shape.tolerance, **counts}
    return BakedField(place | record, np.frombuffer(data + bytes(-len(data) % 4), np.float32))


def placed(field: BakedField, world_from_mesh: transforms.Similarity, name: str | None = None) -> BakedField:
    """The same field elsewhere, under another name where one is given."""
    changed = {"world_from_mesh": world_from_mesh.to_dict(), "name": name or field.record["name"]}
    return BakedField(field.record | changed, field.numbers)


def together(fields: list[BakedField]) -> tuple[list[dict[str, Any]], Float32[np.ndarray, "n"]]:
    """Records and numbers of several fields, as one block; numbers that fields share are there once.

    Raises:
      InputError: there is no field.
    """
    if not fields:
        raise checks.InputError("a page needs at least one field; got none")
    offsets: dict[int, int] = {}
    numbers, total = [], 0
    for field in fields:
        if id(field.numbers) not in offsets:
            offsets[id(field.numbers)] = total
            numbers.append(field.numbers)
            total += len(field.numbers)
    return [field.record | {"offset": offsets[id(field.numbers)]} for field in fields], np.concatenate(numbers)


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
    `first`, which is seen until the page has drawn its own.
    """

    title: str
    about: str
    corners: Float[np.ndarray, "8 3"]
    fields: list[BakedField]
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
    records, numbers = together(page.fields)
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


ELEVATION = 25.0  # of the page's first camera, degrees
_SIZE = 384  # pixels a side
_DARK, _CLAY = np.array([24.0, 26.0, 32.0]), np.array([214.0, 201.0, 182.0])


def first(field: framed_field.FramedField, azimuth: float, up: str = "y") -> bytes:
    """Clay under a light at the camera, clear where nothing is seen, as WebP.

    Args:
      field: with normals. azimuth: of the camera, degrees; its radius is that from which the picture holds the box.
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
