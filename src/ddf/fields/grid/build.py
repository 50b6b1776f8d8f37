"""Patches of a mesh: cells are cut until their patches are as near to the triangles as asked, both ways."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from ddf.core import checks
from ddf.fields.grid import kernels, octree
from ddf.geometry import mesh_io, raycast

_PARTS_MET = 5  # patches that cutting a cell adds, about


@dataclass(frozen=True)
class PatchConfig:
    """How near patches come, and how many there may be.

    tolerance: largest distance between triangles and patches, of half the longest side; twice that the other way.
    patches: at most about so many, 8 to 14 bytes each; where they run out the worst cells are cut first.
    depth: how often a base cell may be cut.
    """

    tolerance: float = 3e-4
    patches: int = 60_000
    depth: int = 6

    def __post_init__(self) -> None:
        if not 1e-6 <= self.tolerance <= 0.1:
            raise checks.InputError(f"patches.tolerance must be in 1e-6..0.1; got {self.tolerance}")
        if self.patches < 1 or not 0 <= self.depth <= kernels.DEEPEST:
            raise checks.InputError(
                f"patches.patches must be >= 1, depth in 0..{kernels.DEEPEST}; got {self.patches}, {self.depth}"
            )


def build(mesh: mesh_io.Mesh, config: PatchConfig) -> dict[str, np.ndarray]:
    """The arrays of `octree.pack` of a mesh in [-1, 1]³.

    Raises:
      InputError: no triangle has an area.
    """
    scene = raycast.Scene(mesh)
    if len(scene.kept) == 0:
        raise checks.InputError("the mesh has no triangle with an area")
    corners, normals = mesh.triangles[scene.kept], scene.normals[scene.kept]
    lows, side = np.full((1, 3), -1.0), 2.0
    starts, triangles = np.array([0, len(corners)]), np.arange(len(corners))
    for _ in range(int(np.log2(octree.BASE))):
        every = np.ones(len(triangles), bool)
        lows, starts, triangles = kernels.cut_cells(corners, lows, side, starts, triangles, every)
        side /= 2
    order = np.lexsort(lows.T[::-1])  # x slowest: as `octree.base_lows`
    lows, (starts, triangles) = lows[order], _reordered(starts, triangles, order)
    states, rows, codes, sides, used = [], [], [], [], 0
    for depth in range(config.depth + 1):
        last = depth == config.depth
        fitted = kernels.fit_cells(corners, normals, lows, side, starts, triangles, config.tolerance, last)
        row, code, count, error, met = fitted
        near = np.flatnonzero((count > 0) & (error <= config.tolerance))
        strays = _strays(scene, row[near], code[near], count[near], lows[near] + side / 2, side)
        error[near] = np.maximum(error[near], strays / 2)
        bad = np.flatnonzero((count > 0) & (error > config.tolerance))
        room = 0 if last else max(0, config.patches - used - int(count.sum())) // _PARTS_MET
        cut = np.zeros(len(lows), bool)
        cut[bad[np.argsort(-error[bad], kind="stable")[:room]]] = True
        fineness = np.log2(config.tolerance / np.clip(error, config.tolerance / 2**kernels.FINEST, config.tolerance))
        code[:, 0] |= fineness.astype(np.int64) << kernels.FINENESS
        code[bad, 0] |= kernels.ROUGH
        state = np.where(cut, octree.CUT, np.where(count > 0, octree.LEAF, octree.EMPTY))
        kept = (np.arange(kernels.MOST) < count[:, None]) & (state == octree.LEAF)[:, None]
        states.append(state)
        rows.append(row[kept])
        codes.append(code[kept])
        sides.append(np.full(int(kept.sum()), side))
        used += int(kept.sum())
        if not cut.any():
            break
        inside, starts = np.repeat(cut, np.diff(starts)), _only(starts, cut)
        cells = lows[cut], side, starts, triangles[inside], met[inside]
        lows, starts, triangles = kernels.cut_cells(corners, *cells)
        side /= 2
    return octree.pack(*(np.concatenate(part) for part in (states, rows, codes, sides)))


def _only(starts: np.ndarray, kept: Bool[np.ndarray, "n"]) -> np.ndarray:
    """Where the lists of the kept cells begin when the others are gone."""
    return np.concatenate([[0], np.cumsum(np.diff(starts)[kept])])


def _reordered(starts: np.ndarray, values: np.ndarray, order: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lists of cells in another order of the cells."""
    lengths = np.diff(starts)[order]
    begins = np.concatenate([[0], np.cumsum(lengths)])
    return begins, values[np.arange(begins[-1]) + np.repeat(starts[:-1][order] - begins[:-1], lengths)]


def _strays(
    scene: raycast.Scene,
    rows: Float[np.ndarray, "n k 7"],
    codes: np.ndarray,
    counts: np.ndarray,
    centres: Float[np.ndarray, "n 3"],
    side: float,
) -> Float[np.ndarray, "n"]:
    """How far the patches of each cell stray from the mesh, as samples tell."""
    used = np.arange(kernels.MOST) < counts[:, None]
    cell = np.nonzero(used)[0]
    samples = kernels.sample_patches(rows[used], codes[used], np.full(len(cell), side)) + centres[cell][:, None]
    here = np.isfinite(samples[..., 0])
    distance, worst = np.zeros(here.shape), np.zeros(len(rows))
    if here.any():
        distance[here] = scene.distance(samples[here])
    np.maximum.at(worst, cell, distance.max(axis=1))
    return worst
