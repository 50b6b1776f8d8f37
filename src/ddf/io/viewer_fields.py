"""Fields as the viewer's page holds them: patches as in their file, sine networks with all factors in the weights.

With h_l = m_l sin(ω_l (W_l h_{l-1} + b_l)) of `siren`, the states sin(ω_l (W_l h_{l-1} + b_l)) are those of a network
with weights ω_l W_l diag(m_{l-1}) and biases ω_l b_l, whose head is W diag(m_L): derived here. So one shader draws
fields of one shape, reconstructions and samples.
"""

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from jaxtyping import Float32

from ddf.core import arrays, checks
from ddf.fields import field_file
from ddf.geometry import transforms

if TYPE_CHECKING:
    from ddf.fields import shape_field
    from ddf.fields.grid import patch_field

_PATCHES = ("codes", "planes", "bends", "cells")  # arrays of patches in the order of their bytes
_OUTPUTS = 4  # of a network of two components


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
      InputError: as `FieldFile.layers`, or the field has not the two components that the page draws.
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
    outputs = len(layers[-1][1])
    if outputs != _OUTPUTS:
        raise checks.InputError(f"{name}: the page draws fields of two components; got {outputs // 2}")
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
