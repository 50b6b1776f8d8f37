"""MD2, the models of Quake II and of games after it: triangles of the first frame, with the first skin."""

import struct

import numpy as np

from ddf.core import checks
from ddf.geometry.formats.ac3d import Material, Surfaces

_HEADER = struct.Struct("<4s16i")
_SKIN = 64  # bytes of the path of a skin


def surfaces(data: bytes) -> Surfaces:
    """The triangles of a file in its frame: x ahead, y to the left, z up; coordinates are of 8 bits.

    Raises:
      InputError: no MD2 file, or cut short.
    """
    if len(data) < _HEADER.size or not data.startswith(b"IDP2"):
        raise checks.InputError("not an MD2 file: it must begin with IDP2")
    _, _, width, height, _, skins, points, places, triangles, _, _, at_skins, at_places, at_triangles, at_frame, *_ = (
        _HEADER.unpack_from(data)
    )
    try:
        frame = np.frombuffer(data, "<f4", 6, at_frame).reshape(2, 3).astype(np.float64)
        packed = np.frombuffer(data, "u1", 4 * points, at_frame + 40).reshape(-1, 4)[:, :3]
        corners = np.frombuffer(data, "<u2", 6 * triangles, at_triangles).reshape(-1, 2, 3)[:, :, ::-1]  # clockwise
        uvs = np.frombuffer(data, "<i2", 2 * places, at_places).reshape(-1, 2) / (width, height)
        uvs = np.stack([uvs[:, 0], 1 - uvs[:, 1]], axis=1)[corners[:, 1].ravel()]
        skin = data[at_skins : at_skins + _SKIN].split(b"\0")[0].decode("ascii", "replace").lstrip(".") if skins else ""
        vertices = packed * frame[0] + frame[1]
        vertices[corners[:, 0].ravel()]  # all there
    except (ValueError, IndexError, ZeroDivisionError) as error:
        raise checks.InputError(f"damaged MD2 file: {error}") from error
    none = np.full(triangles, -1)
    skinned = none + 1 if skin else none
    return Surfaces(
        vertices, none + 4, corners[:, 0].ravel().astype(np.int64), uvs, none, skinned, (), (skin,) if skin else ()
    )
