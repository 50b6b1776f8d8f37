"""A watertight mesh of what parallel looks from many sides leave of a box (derived here).

From each side a depth image is taken. A point in front of what its pixel sees is outside, by as far as it is in front;
some views may err, so the `_DOUBTED`-th smallest of these distances counts. Where it is `_SKIN`, between nodes of a
grid, manifold3d makes a mesh, closed by construction, whose vertices then go back: sheets that look thinner than
nothing from both sides stay. Hollows that few sides look into are full.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from scipy import ndimage

from ddf.core import checks
from ddf.geometry import rays, transforms
from ddf.geometry.mesh_io import Mesh, face_normals

# starts (n, 3), unit directions (n, 3) -> depth (n), inf where nothing is seen
Look = Callable[[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]], Float[np.ndarray, "n"]]
_SIDES, _DOUBTED = 42, 6
_SKIN, _BACK = 1.0, 0.5  # cells; half of them, for views that graze are farther in front than the surface is away
_MARGIN, _REACH = 2, 2.0  # cells: around the box, and distances that count


def extract(look: Look, lower: Float[np.ndarray, "3"], upper: Float[np.ndarray, "3"], resolution: int) -> Mesh:
    """The closed surface in a box, in its frame.

    Args:
      resolution: cells of the longest side; depth images have as many pixels a cell's length.
    Raises:
      InputError: nothing is left.
    """
    import manifold3d

    cell = float((upper - lower).max()) / resolution
    origin, shape = lower - _MARGIN * cell, np.ceil((upper - lower) / cell).astype(int) + 2 * _MARGIN + 1
    centre, values = (lower + upper) / 2, np.full(np.prod(shape), -_REACH)
    grid = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    nodes, left = (origin + cell * grid - centre).astype(np.float32), np.arange(len(grid))
    corners = transforms.box_corners(nodes[0], nodes[-1])
    least = np.full((_DOUBTED, len(nodes)), _REACH, dtype=np.float32)
    for way in rays.evenly_spread(_SIDES):
        behind = _behind(look, nodes, corners, centre, way, cell)
        for row in least:  # ascending, of each node
            row[:], behind = np.minimum(row, behind), np.maximum(row, behind)
        open_still = least[-1] > -_REACH  # the others are as far out as counts, whatever further views say
        nodes, left, least = nodes[open_still], left[open_still], least[:, open_still]
    values[left] = least[-1]
    value = _between(values.reshape(shape), origin, cell)
    box = [*origin, *(origin + cell * (shape - 1))]
    made = manifold3d.Manifold.level_set(value, box, cell, -_SKIN).to_mesh()
    if len(made.tri_verts) == 0:
        raise checks.InputError("nothing is left that all sides see: fit the field for longer")
    mesh = Mesh(np.asarray(made.vert_properties[:, :3]), np.asarray(made.tri_verts))
    normals, areas = face_normals(mesh)
    outward = np.zeros_like(mesh.vertices)
    np.add.at(outward, mesh.faces.ravel(), np.repeat(areas[:, None] * normals, 3, axis=0))
    length = np.linalg.norm(outward, axis=1, keepdims=True)
    return Mesh(mesh.vertices - _BACK * cell * outward / np.where(length > 0, length, 1.0), mesh.faces)


def _behind(
    look: Look,
    nodes: Float[np.ndarray, "n 3"],
    corners: Float[np.ndarray, "8 3"],
    centre: Float[np.ndarray, "3"],
    way: Float[np.ndarray, "3"],
    cell: float,
) -> Float[np.ndarray, "n"]:
    """How far nodes are behind what is seen along a way, in cells up to `_REACH`; of four pixels each, linearly."""
    right = np.linalg.svd(way[None])[2][1:]  # two axes across
    low, start = (corners @ right.T).min(axis=0), (corners @ way).min() - cell
    count = np.ceil(((corners @ right.T).max(axis=0) - low) / cell).astype(int) + 2
    pixels = low + cell * np.stack(np.meshgrid(*map(np.arange, count), indexing="ij"), axis=-1).reshape(-1, 2)
    starts = centre + pixels @ right + start * way
    seen = (look(starts, np.broadcast_to(way, starts.shape).copy()) / cell).astype(np.float32)
    axes = np.stack([*right, way]).astype(np.float32) / np.float32(cell)
    x, y, far = axes @ nodes.T - (np.array([*low, start]) / cell).astype(np.float32)[:, None]
    i, j = (np.clip(np.floor(each), 0, None).astype(np.int32) for each in (x, y))
    x, y, at, total = x - i, y - j, i * count[1] + j, np.zeros_like(far)
    for step, share in ((0, (1 - x) * (1 - y)), (1, (1 - x) * y), (count[1], x * (1 - y)), (count[1] + 1, x * y)):
        total += share * np.clip(far - seen[at + step], -_REACH, _REACH)
    return total.clip(-_REACH, _REACH)


def _between(
    values: Float[np.ndarray, "x y z"], origin: Float[np.ndarray, "3"], cell: float
) -> Callable[[float, float, float], float]:
    """Values between the nodes, linearly; asked one by one, so in plain numbers."""
    flat, (size_x, size_y, size_z) = values.ravel().tolist(), values.shape
    outside = (ndimage.maximum_filter(values, 2, origin=-1) <= -_REACH).ravel().tolist()  # all corners of the cell
    ox, oy, oz = origin.tolist()
    y_step, x_step = size_z, size_y * size_z

    def value(x: float, y: float, z: float) -> float:
        x, y, z = (x - ox) / cell, (y - oy) / cell, (z - oz) / cell
        if not (0 <= x < size_x - 1 and 0 <= y < size_y - 1 and 0 <= z < size_z - 1):
            return -_REACH
        i, j, k = int(x), int(y), int(z)
        x, y, z, at, sides = x - i, y - j, z - k, (i * size_y + j) * size_z + k, []
        if outside[at]:
            return -_REACH
        for side in (at, at + x_step):
            near = (1 - z) * flat[side] + z * flat[side + 1]
            beyond = (1 - z) * flat[side + y_step] + z * flat[side + y_step + 1]
            sides.append((1 - y) * near + y * beyond)
        return (1 - x) * sides[0] + x * sides[1]

    return value
