"""Fields as the viewer's page holds them: plain sine networks, frequencies and modulations baked into the weights.

With h_l = m_l sin(ω_l (W_l h_{l-1} + b_l)) of `siren`, the states sin(ω_l (W_l h_{l-1} + b_l)) are those of a network
with weights ω_l W_l diag(m_{l-1}) and biases ω_l b_l, whose head is W diag(m_L): derived here. So one shader draws
fields of one shape, reconstructions and samples.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float32

from ddf.core import arrays, checks
from ddf.fit import shape_field
from ddf.geometry import transforms


@dataclass(frozen=True)
class BakedField:
    """A field for the page.

    record: JSON, as `FieldRecord` of the page's sources; `offset` is where its numbers begin. numbers: weights, row by
    row, and biases, layer after layer, the head last.
    """

    record: dict[str, Any]
    numbers: Float32[np.ndarray, "n"]


def bake(shape: shape_field.ShapeField, name: str) -> BakedField:
    """A field for a page in the frame of its mesh; see `placed`."""
    network, config = shape.field.network, shape.field.config
    numbers, before = [], None
    for index, (layer, omega) in enumerate(zip(network.layers, network.omegas, strict=True)):
        numbers += _layer(layer, omega, before)
        before = None if shape.modulations is None else arrays.to_numpy(shape.modulations[index]).reshape(-1)
    numbers += _layer(network.head, 1.0, before)
    record = {
        "name": name,
        "widths": [network.layers[0].in_features, *config.hidden, network.head.out_features],
        "offset": 0,
        "depth_activation": config.depth_activation,
        "depth_sharpness": config.depth_sharpness,
        "lower": shape.lower.tolist(),
        "upper": shape.upper.tolist(),
        "field_from_mesh": shape.field_from_mesh.to_dict(),
        "world_from_mesh": transforms.Similarity().to_dict(),
    }
    return BakedField(record, np.concatenate(numbers).astype(np.float32))


def placed(field: BakedField, world_from_mesh: transforms.Similarity, name: str | None = None) -> BakedField:
    """The same field elsewhere, under another name where one is given."""
    changed = {"world_from_mesh": world_from_mesh.to_dict(), "name": name or field.record["name"]}
    return BakedField(field.record | changed, field.numbers)


def _layer(layer: Any, omega: float, before: np.ndarray | None) -> list[np.ndarray]:
    """Weights and biases of one layer, float64, flat; before: modulations of the states that come in."""
    weight, bias = (arrays.to_numpy(values).astype(np.float64) for values in (layer.weight, layer.bias))
    weight = omega * weight if before is None else omega * weight * before
    return [weight.reshape(-1), omega * bias]


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
