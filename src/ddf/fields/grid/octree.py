"""The cells and patches of a field: as rays walk through them, as a file holds them, and how they are made of a mesh.

In a file everything is in the order of levels: the states of the R³ base cells (x slowest), then those of the eight
parts of each cell that is cut, level after level; the patches of leaves in that order. Sides halve from level to level.
Cells of a mesh are cut until their patches are as near to the triangles as asked, both ways.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, UInt

from ddf.core import checks
from ddf.fields.grid import kernels
from ddf.geometry import mesh_io, raycast

BASE = 16  # cells of the base along a side
EMPTY, LEAF, CUT = 0, 1, 2  # states
BENT = 1 << 10  # of a code in a file: the patch is no plane
ONE = 32767  # of int16
_PARTS = np.indices((2, 2, 2)).reshape(3, -1).T  # least corners of the parts of a cell, in its halves
_TYPES = {"cells": np.uint8, "codes": np.uint16, "planes": np.int16, "bends": np.int16}
UNSEEN = "unseen"  # an array of some files: a bit a cell, in their order, that no ray passed through or ended in
# least corners (n, 3), side -> which cells some ray passed through, and in which one ended
Evidence = Callable[[Float[np.ndarray, "n 3"], float], tuple[Bool[np.ndarray, "n"], Bool[np.ndarray, "n"]]]


@dataclass(frozen=True)
class Octree:
    """What `kernels.trace` walks through, and where the patches are: centre and side of the cell of each."""

    base: Int[np.ndarray, "r r r"]
    children: Int[np.ndarray, "k 8"]
    patches: Float[np.ndarray, "n 7"]
    codes: UInt[np.ndarray, "n"]
    centres: Float[np.ndarray, "n 3"]
    sides: Float[np.ndarray, "n"]


def pack(
    states: Int[np.ndarray, "m"],
    rows: Float[np.ndarray, "n 7"],
    codes: Int[np.ndarray, "n"],
    sides: Float[np.ndarray, "n"],
) -> dict[str, np.ndarray]:
    """The arrays of a file: 2 bits a cell, 8 bytes a plane, 14 a paraboloid.

    A normal is two coordinates on the octahedron, an offset is over the side, A, B, C are times the side over
    `kernels.MOST_BENT`.
    """
    quads = np.pad(states, (0, -len(states) % 4)).reshape(-1, 4).astype(np.uint8)
    bent = (rows[:, 4:] != 0).any(axis=1)
    folded = rows[:, :2] / np.abs(rows[:, :3]).sum(axis=1, keepdims=True)
    below = (1 - np.abs(folded[:, ::-1])) * np.where(folded >= 0, 1.0, -1.0)
    folded = np.where(rows[:, 2:3] >= 0, folded, below)
    planes = np.concatenate([folded, rows[:, 3:4] / sides[:, None]], axis=1)
    bends = rows[bent, 4:] * sides[bent, None] / kernels.MOST_BENT
    return {
        "cells": quads @ np.array([1, 4, 16, 64], np.uint8),
        "codes": (codes + BENT * bent).astype(np.uint16),
        "planes": np.rint(np.clip(planes, -1, 1) * ONE).astype(np.int16),
        "bends": np.rint(np.clip(bends, -1, 1) * ONE).astype(np.int16),
    }


def unpack(arrays: Mapping[str, np.ndarray]) -> Octree:
    """The inverse of `pack`; InputError where the arrays are not those, or contradict each other."""
    for name, kind in _TYPES.items():
        if name not in arrays or arrays[name].dtype != kind:
            raise checks.InputError(f"{name} must be there as {np.dtype(kind)}")
    codes, planes, bends = arrays["codes"].astype(np.int64), arrays["planes"], arrays["bends"]
    states = (arrays["cells"][:, None] >> np.array([0, 2, 4, 6], np.uint8) & 3).reshape(-1)
    last = np.flatnonzero(codes & kernels.LAST) + 1
    bent = (codes & BENT) != 0
    leaves, per_leaf = (states == LEAF).sum(), np.diff(last, prepend=0)
    cells = BASE**3 + 8 * (states == CUT).sum()
    sound = len(last) == leaves and last.max(initial=0) == len(codes) and per_leaf.max(initial=0) <= kernels.MOST
    sound &= planes.shape == (len(codes), 3) and bends.shape == (bent.sum(), 3)
    if sound:  # no patch is cut by one that is not there
        sound = not ((codes >> 2 & 255) >> 2 * np.repeat(per_leaf, per_leaf)).any()
    if not sound or (states > CUT).any() or not 0 <= len(states) - cells < 4 or states[cells:].any():
        raise checks.InputError("its cells and patches do not fit together")
    states, lows, begin, side = states[:cells], base_lows(), 0, 2.0 / BASE
    centres, sides = [], []
    while len(lows):  # one level
        level = states[begin : begin + len(lows)]
        centres.append(lows[level == LEAF] + side / 2)
        sides.append(np.full(len(centres[-1]), side))
        begin, side = begin + len(lows), side / 2
        lows = (lows[level == CUT][:, None] + side * _PARTS).reshape(-1, 3)
    if begin != cells or len(sides) > kernels.DEEPEST + 1:
        raise checks.InputError("its cells and patches do not fit together")
    nodes = np.zeros(cells, np.int32)
    nodes[states == LEAF] = np.concatenate([[0], last[:-1]])[:leaves] + 1
    nodes[states == CUT] = -1 - np.arange((states == CUT).sum())
    codes = arrays["codes"]
    if UNSEEN in arrays:
        unseen = np.unpackbits(arrays[UNSEEN], count=cells).astype(bool)
        codes = codes.copy()
        codes[nodes[unseen & (states == LEAF)] - 1] |= kernels.GUESSED
        nodes[unseen & (states == EMPTY)] = kernels.UNKNOWN
    side, centre = (np.repeat(np.concatenate(part), per_leaf, axis=0) for part in (sides, centres))
    rows = np.zeros((len(codes), kernels.WIDTH))
    rows[:, :3], rows[:, 3] = _unfolded(planes[:, :2] / ONE), planes[:, 2] / ONE * side
    rows[bent, 4:] = bends / ONE * kernels.MOST_BENT / side[bent, None]
    base, children = nodes[: BASE**3].reshape(3 * (BASE,)), nodes[BASE**3 :].reshape(-1, 8)
    return Octree(base, children, rows.astype(np.float32), codes, centre, side)


def base_lows() -> Float[np.ndarray, "m 3"]:
    """Least corners of the base cells, in the order of a file."""
    return np.indices(3 * (BASE,)).reshape(3, -1).T * (2.0 / BASE) - 1


def _unfolded(folded: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 3"]:
    """Unit normals of coordinates on the octahedron."""
    height = 1 - np.abs(folded).sum(axis=1)
    flat = folded - np.where(folded >= 0, 1, -1) * np.maximum(-height, 0)[:, None]
    normals = np.concatenate([flat, height[:, None]], axis=1)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


_PARTS_MET = 5  # patches that cutting a cell adds, about


@dataclass(frozen=True)
class PatchConfig:
    """How near patches come, and how many there may be.

    tolerance: wanted distance between triangles and patches, of half the longest side; twice that the other way.
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

    @classmethod
    def within(cls, tolerance: float | None) -> "PatchConfig":
        """The default, and more patches and depth where a tolerance asks for more: 103,923 and 7 of 1e-4."""
        if tolerance is None:
            return cls()
        finer = max(1.0, cls.tolerance / max(tolerance, 1e-6))
        return cls(tolerance, round(cls.patches * finer**0.5), cls.depth + round(math.log2(finer) / 2))


def build(mesh: mesh_io.Mesh, config: PatchConfig, evidence: Evidence | None = None) -> dict[str, np.ndarray]:
    """The arrays of `octree.pack` of a mesh in [-1, 1]³, and `UNSEEN` where there is evidence of what was seen;
    InputError where no triangle has an area.
    """
    scene = raycast.Scene(mesh)
    if len(scene.kept) == 0:
        raise checks.InputError("the mesh has no triangle with an area")
    corners, normals = mesh.triangles[scene.kept], scene.normals[scene.kept]
    lows, side = np.full((1, 3), -1.0), 2.0
    starts, triangles = np.array([0, len(corners)]), np.arange(len(corners))
    for _ in range(int(np.log2(BASE))):
        every = np.ones(len(triangles), bool)
        lows, starts, triangles = kernels.cut_cells(corners, lows, side, starts, triangles, every)
        side /= 2
    order = np.lexsort(lows.T[::-1])  # x slowest: as `octree.base_lows`
    lows, (starts, triangles) = lows[order], _reordered(starts, triangles, order)
    states, rows, codes, sides, unseen, used = [], [], [], [], [], 0
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
        state = np.where(cut, CUT, np.where(count > 0, LEAF, EMPTY))
        kept = (np.arange(kernels.MOST) < count[:, None]) & (state == LEAF)[:, None]
        if evidence is not None:
            free, ended = evidence(lows, side)
            unseen.append(~np.where(count > 0, ended, free))
        states.append(state)
        rows.append(row[kept])
        codes.append(code[kept])
        sides.append(np.full(int(kept.sum()), side))
        used += int(kept.sum())
        if not cut.any():
            break
        counts = np.diff(starts)
        inside, starts = np.repeat(cut, counts), np.cumsum([0, *counts[cut]])
        cells = lows[cut], side, starts, triangles[inside], met[inside]
        lows, starts, triangles = kernels.cut_cells(corners, *cells)
        side /= 2
    arrays = pack(*(np.concatenate(part) for part in (states, rows, codes, sides)))
    return arrays if evidence is None else {**arrays, UNSEEN: np.packbits(np.concatenate(unseen))}


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
