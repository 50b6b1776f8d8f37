"""MD2, the models of Quake II and of games after it: triangles of the first frame, with the first skin."""

import struct

import numpy as np

from ddf.core import checks
from ddf.geometry.formats.ac3d import Surfaces

_HEADER = struct.Struct("<4s16i")
_SKIN, _FRAME = 64, 40  # bytes of a skin's path, and before the points of a frame


def surfaces(data: bytes) -> Surfaces:
    """The triangles of a file in its frame, z up; coordinates are of 8 bits, skins lack the ending of their picture.

    Raises:
      InputError: no MD2 file, or damaged.
    """
    if len(data) < _HEADER.size or not data.startswith(b"IDP2"):
        raise checks.InputError("not an MD2 file: it must begin with IDP2")
    _, _, width, height, _, skins, points, places, count, _, _, skin, place, triangle, frame, *_ = _HEADER.unpack_from(
        data
    )
    try:
        scale, origin = np.frombuffer(data, "<f4", 6, frame).reshape(2, 3).astype(np.float64)
        packed = np.frombuffer(data, "u1", 4 * points, frame + _FRAME).reshape(-1, 4)[:, :3]
        both = np.frombuffer(data, "<u2", 6 * count, triangle).reshape(-1, 2, 3)[:, :, ::-1]  # they run clockwise
        corners, at = both.transpose(1, 0, 2).reshape(2, -1).astype(np.int64)
        uvs = np.frombuffer(data, "<i2", 2 * places, place).reshape(-1, 2)[at] / (width, height)
    except (ValueError, IndexError) as error:
        raise checks.InputError(f"damaged MD2 file: {error}") from error
    if count and corners.max() >= points:
        raise checks.InputError("damaged MD2 file: a triangle uses a point that is not there")
    names = [data[skin : skin + _SKIN].split(b"\0")[0].decode("ascii", "replace").lstrip(".")][:skins]
    none = np.full(count, -1)
    return Surfaces(
        packed * scale + origin,
        np.full(count, 3),
        corners,
        uvs * (1, -1) + (0, 1),
        none,
        none + len(names),
        (),
        tuple(names),
    )
