"""Depth images from fewer rays: a lattice of pixels, refined only where interpolation would not do (derived here).

Along a plane the inverse of the depth is all but linear in the pixel, so most pixels of a surface, and of the
background, follow from those around them. What may be lost is a part narrower than the lattice.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ddf import checks

Ask = Callable[[Int[np.ndarray, "k"]], Float[np.ndarray, "k"]]  # pixels, by row * size + column, to depths


@dataclass(frozen=True)
class Refinement:
    """How an image is refined.

    stride: pixels between two of the first lattice, a power of two. tolerance: by how much interpolation may miss the
    depth in the middle of a cell, in its unit.
    """

    tolerance: float
    stride: int = 4

    def __post_init__(self) -> None:
        if not 0 <= self.tolerance < np.inf:
            raise checks.InputError(f"tolerance must be >= 0; got {self.tolerance}")
        if self.stride < 1 or self.stride & (self.stride - 1):
            raise checks.InputError(f"stride must be a power of two; got {self.stride}")


def depth_image(ask: Ask, size: int, how: Refinement) -> tuple[Float[np.ndarray, "size size"], int]:
    """An image of `size` pixels a side, and of how many of them the depth was asked for.

    A cell between four pixels of the lattice is interpolated where they and the pixel in its middle all see nothing, or
    all see a surface that the four foretell; else it is cut in four, down to single pixels.

    Args:
      ask: depth of pixels, `inf` where nothing is seen. Called at most 1 + 2 log2(stride) times.
    """
    canvas = _Canvas(ask, size)
    lines = np.unique([*range(0, size, how.stride), size - 1])
    canvas.fetch(*np.meshgrid(lines, lines, indexing="ij"))
    top, left = np.meshgrid(lines[:-1], lines[:-1], indexing="ij")
    bottom, right = np.meshgrid(lines[1:], lines[1:], indexing="ij")
    cells = np.stack([top, left, bottom, right]).reshape(4, -1)
    step = how.stride
    while step > 1:
        middle = np.minimum(cells[:2] + step // 2, cells[2:])
        canvas.fetch(*middle)
        rough = ~canvas.fill(cells, middle, step, how.tolerance)
        (top, left, bottom, right), (row, column) = cells[:, rough], middle[:, rough]
        canvas.fetch(np.stack([top, bottom, row, row]), np.stack([column, column, left, right]))
        parts = [
            (top, left, row, column),
            (top, column, row, right),
            (row, left, bottom, column),
            (row, column, bottom, right),
        ]
        cells = np.concatenate(parts, axis=1)
        cells = cells[:, (cells[2:] > cells[:2]).all(axis=0)]
        step //= 2
    return canvas.depth(), int(canvas.asked.sum())


class _Canvas:
    """Inverse depths of an image under way, 0 where nothing is seen, and which of them were asked for."""

    def __init__(self, ask: Ask, size: int) -> None:
        self.ask, self.size = ask, size
        self.inverse, self.asked = np.zeros(size * size), np.zeros(size * size, bool)

    def fetch(self, row: Int[np.ndarray, "*n"], column: Int[np.ndarray, "*n"]) -> None:
        """Ask for pixels, each once."""
        wanted = np.zeros_like(self.asked)
        wanted[row * self.size + column] = True
        new = np.flatnonzero(wanted & ~self.asked)
        if len(new):
            self.inverse[new] = 1 / np.maximum(self.ask(new), np.finfo(np.float64).tiny)
            self.asked[new] = True

    def fill(
        self, cells: Int[np.ndarray, "4 n"], middle: Int[np.ndarray, "2 n"], step: int, tolerance: float
    ) -> Bool[np.ndarray, "n"]:
        """Interpolate the cells whose corners foretell their middle; returns which need no more.

        Args:
          cells: top, left, bottom and right. middle: row and column. step: the longest side of a cell.
        """
        (top, left, bottom, right), (row, column) = cells, middle
        corners = [self.inverse[i * self.size + j] for i in (top, bottom) for j in (left, right)]
        centre = self.inverse[row * self.size + column]
        down, across = (row - top) / (bottom - top), (column - left) / (right - left)
        foretold = _bilinear(corners, down, across)
        seen = np.stack([*corners, centre]) > 0
        with np.errstate(divide="ignore", invalid="ignore"):
            close = np.abs(1 / foretold - 1 / centre) <= tolerance
        shown = seen.all(axis=0) & close  # where nothing is seen, the canvas says so already
        rows, columns = (start[shown, None] + np.arange(step + 1) for start in (top, left))
        down = (rows - top[shown, None]) / (bottom - top)[shown, None]
        across = (columns - left[shown, None]) / (right - left)[shown, None]
        values = _bilinear([corner[shown, None, None] for corner in corners], down[:, :, None], across[:, None, :])
        index = rows[:, :, None] * self.size + columns[:, None, :]
        inside = (down <= 1)[:, :, None] & (across <= 1)[:, None, :]
        index, values = index[inside], values[inside]
        new = ~self.asked[index]
        self.inverse[index[new]] = values[new]
        return shown | ~seen.any(axis=0)

    def depth(self) -> Float[np.ndarray, "size size"]:
        """Of all pixels, `inf` where nothing is seen."""
        with np.errstate(divide="ignore"):
            return (1 / self.inverse).reshape(self.size, self.size)


def _bilinear(corners: list[np.ndarray], down: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Of the values at the top left, top right, bottom left and bottom right."""
    first, second, third, fourth = corners
    top, bottom = first + across * (second - first), third + across * (fourth - third)
    return top + down * (bottom - top)
