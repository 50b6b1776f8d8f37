"""First hits for Triton: each ray is tried on every triangle of its mesh, so that there is no tree to build or to walk.

Source: Woop et al. 2013, "Watertight ray/triangle intersection", in float32. Corners are seen from the ray's start, in
a frame whose third axis is the ray. A corner gets there by the same sums whatever triangle it belongs to, and the two
products of an edge function are rounded one by one: so its signs in the two triangles of an edge are opposite to the
last bit. Zero counts as inside, and no ray slips between two triangles. Depths are mixed from those of the corners, so
that a triangle that a ray grazes is not met far from where it is.
"""

from typing import Any

import torch
import triton
import triton.language as tl
from jaxtyping import Float, Int
from torch import Tensor

RAYS, WARPS = 128, 4  # of a program, whose threads have a ray each


@triton.jit
def _along(x, y, z, a, b, c):
    return tl.fma(z, c, tl.fma(y, b, x * a))


@triton.jit
def _first_hits(rays, ranges, corners, depth, triangle, count, columns, TRIANGLES: tl.constexpr, RAYS: tl.constexpr):
    mesh, own = tl.program_id(1), tl.program_id(0) * RAYS + tl.arange(0, RAYS)
    first, last = tl.multiple_of(tl.load(ranges + 2 * mesh), TRIANGLES), tl.load(ranges + 2 * mesh + 1)
    there, step, row = own < count, tl.num_programs(1) * count, columns.to(tl.int64)
    ray = rays + mesh * count + own
    # start and frame, which are 0 of rays that fill the block: they meet nothing
    ox = tl.load(ray, mask=there, other=0.0)[None, :]
    oy = tl.load(ray + step, mask=there, other=0.0)[None, :]
    oz = tl.load(ray + 2 * step, mask=there, other=0.0)[None, :]
    xx = tl.load(ray + 3 * step, mask=there, other=0.0)[None, :]
    xy = tl.load(ray + 4 * step, mask=there, other=0.0)[None, :]
    xz = tl.load(ray + 5 * step, mask=there, other=0.0)[None, :]
    yx = tl.load(ray + 6 * step, mask=there, other=0.0)[None, :]
    yy = tl.load(ray + 7 * step, mask=there, other=0.0)[None, :]
    yz = tl.load(ray + 8 * step, mask=there, other=0.0)[None, :]
    zx = tl.load(ray + 9 * step, mask=there, other=0.0)[None, :]
    zy = tl.load(ray + 10 * step, mask=there, other=0.0)[None, :]
    zz = tl.load(ray + 11 * step, mask=there, other=0.0)[None, :]
    nearest = tl.full((TRIANGLES, RAYS), float("inf"), tl.float32)
    which = tl.full((TRIANGLES, RAYS), -1, tl.int32)
    for begin in range(0, (last - first).to(tl.int32), TRIANGLES):
        place = tl.arange(0, TRIANGLES)
        corner = corners + tl.multiple_of(first + begin, TRIANGLES) + place
        ax = tl.load(corner)[:, None] - ox
        ay = tl.load(corner + row)[:, None] - oy
        az = tl.load(corner + 2 * row)[:, None] - oz
        bx = tl.load(corner + 3 * row)[:, None] - ox
        by = tl.load(corner + 4 * row)[:, None] - oy
        bz = tl.load(corner + 5 * row)[:, None] - oz
        cx = tl.load(corner + 6 * row)[:, None] - ox
        cy = tl.load(corner + 7 * row)[:, None] - oy
        cz = tl.load(corner + 8 * row)[:, None] - oz
        px, py = _along(ax, ay, az, xx, xy, xz), _along(ax, ay, az, yx, yy, yz)
        qx, qy = _along(bx, by, bz, xx, xy, xz), _along(bx, by, bz, yx, yy, yz)
        rx, ry = _along(cx, cy, cz, xx, xy, xz), _along(cx, cy, cz, yx, yy, yz)
        u, v, w = rx * qy - ry * qx, px * ry - py * rx, qx * py - qy * px  # edge functions opposite to each corner
        total = u + v + w
        least, most = tl.minimum(tl.minimum(u, v), w), tl.maximum(tl.maximum(u, v), w)
        pz, qz, rz = _along(ax, ay, az, zx, zy, zz), _along(bx, by, bz, zx, zy, zz), _along(cx, cy, cz, zx, zy, zz)
        found = tl.fma(w, rz, tl.fma(v, qz, u * pz)) / tl.where(total == 0, 1.0, total)
        hit = ((least >= 0) | (most <= 0)) & (total != 0) & (found >= 0) & (found < nearest)
        nearest = tl.where(hit, found, nearest)
        which = tl.where(hit, begin + place[:, None], which)
    as_near = nearest == tl.min(nearest, axis=0, keep_dims=True)
    tl.store(depth + mesh * count + own, tl.min(nearest, axis=0), mask=there)
    lowest = tl.min(tl.where(as_near, which, 2147483647), axis=0)
    tl.store(triangle + mesh * count + own, lowest, mask=there)


def first_hits(
    corners: Float[Tensor, "9 columns"], ranges: Int[Tensor, "b 2"], rays: Float[Tensor, "12 b n"], together: int
) -> tuple[Float[Tensor, "b n"], Int[Tensor, "b n"]]:
    """Depth and triangle, numbered from the first of its mesh, of rays against a mesh for each row, `inf` and -1 on a
    miss; of equal depths the first triangle's.

    Args:
      corners: see `meshes.Meshes`; as many columns as 16 divides.
      ranges: first triangle of each row's mesh, and the one after its last; multiples of `together`, a power of two.
      rays: start, and the three rows of `meshes.frames`.
      together: triangles that a thread tries at once.
    """
    rows, count = rays.shape[1:]
    depth = torch.zeros((rows, count), device=rays.device)
    triangle = torch.zeros((rows, count), dtype=torch.int32, device=rays.device)
    how: dict[str, Any] = {"num_warps": WARPS, "enable_fp_fusion": False, "TRIANGLES": together, "RAYS": RAYS}
    grid = (triton.cdiv(count, RAYS), rows)
    _first_hits[grid](rays, ranges, corners, depth, triangle, count, corners.shape[1], **how)
    return depth, triangle
