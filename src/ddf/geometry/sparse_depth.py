"""Depth images from fewer rays: a lattice of pixels, refined only where interpolation would not do (derived here).

Along a plane the inverse of the depth is all but linear in the pixel, so most pixels of a surface, and of the
background, follow from those around them. What may be lost is a part narrower than the lattice.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ddf.core import checks

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
      ask: depth of pixels, `inf` where nothing is seen. Called at most 1 + log2(stride) times.
    """
    canvas = _Canvas(ask, size)
    lines = np.unique([*range(0, size, how.stride), size - 1])
    top, left = np.meshgrid(lines[:-1], lines[:-1], indexing="ij")
    bottom, right = np.meshgrid(lines[1:], lines[1:], indexing="ij")
    cells, step = np.stack([top, left, bottom, right]).reshape(4, -1), how.stride
    middle = _middle(cells, step)
    canvas.fetch(np.stack(np.meshgrid(lines, lines, indexing="ij")), middle)
    while step > 1:
        rough = ~canvas.fill(cells, middle, how.tolerance)
        (top, left, bottom, right), (row, column) = cells[:, rough], middle[:, rough]
        parts = [
            (top, left, row, column),
            (top, column, row, right),
            (row, left, bottom, column),
            (row, column, bottom, right),
        ]
        cells, step = np.concatenate(parts, axis=1), step // 2
        cells = cells[:, (cells[2:] > cells[:2]).all(axis=0)]
        middle = _middle(cells, step)
        canvas.fetch(np.stack([[top, bottom, row, row], [column, column, left, right]]), middle)
    return canvas.depth(), int(canvas.asked.sum())


def _middle(cells: Int[np.ndarray, "4 n"], step: int) -> Int[np.ndarray, "2 n"]:
    """Row and column of the pixel in the middle of each cell, the top left one of a cell of one step."""
    return np.minimum(cells[:2] + step // 2, cells[2:])


class _Canvas:
    """Inverse depths of an image under way, 0 where nothing is seen: those asked for, and those drawn between them."""

    def __init__(self, ask: Ask, size: int) -> None:
        self.ask, self.size = ask, size
        self.known, self.drawn = np.zeros(size * size), np.zeros(size * size)
        self.asked = np.zeros(size * size, bool)

    def fetch(self, *pixels: Int[np.ndarray, "2 *_"]) -> None:
        """Ask for pixels by row and column, each once and all in one call."""
        wanted = np.zeros_like(self.asked)
        for row, column in pixels:
            wanted[row * self.size + column] = True
        new = np.flatnonzero(wanted & ~self.asked)
        if len(new):
            self.known[new] = 1 / np.maximum(self.ask(new), np.finfo(np.float64).tiny)
            self.asked[new] = True

    def fill(
        self, cells: Int[np.ndarray, "4 n"], middle: Int[np.ndarray, "2 n"], tolerance: float
    ) -> Bool[np.ndarray, "n"]:
        """Interpolate the cells whose corners foretell their middle; returns which need no more.

        Args:
          cells: top, left, bottom and right. middle: row and column.
        """
        (top, left, bottom, right), (row, column) = cells, middle
        corners = self.known[np.stack([i * self.size + j for i in (top, bottom) for j in (left, right)])]
        centre = self.known[row * self.size + column]
        foretold = (_bilinear((row - top) / (bottom - top), (column - left) / (right - left)) * corners).sum(axis=0)
        seen = (corners > 0).sum(axis=0) + (centre > 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            close = np.abs(1 / foretold - 1 / centre) <= tolerance
        shown = (seen == len(corners) + 1) & close  # where nothing is seen, the canvas says so already
        shape = (bottom - top) * (self.size + 1) + right - left  # cells at the last row and column may be shorter
        for one in np.unique(shape[shown]):
            height, width = divmod(int(one), self.size + 1)
            alike = np.flatnonzero(shown & (shape == one))
            down, across = (part.ravel() for part in np.mgrid[: height + 1, : width + 1])
            index = (top[alike] * self.size + left[alike])[:, None] + (down * self.size + across)
            self.drawn[index] = corners[:, alike].T @ _bilinear(down / height, across / width)
        return shown | (seen == 0)

    def depth(self) -> Float[np.ndarray, "size size"]:
        """Of all pixels, `inf` where nothing is seen."""
        with np.errstate(divide="ignore"):
            return (1 / np.where(self.asked, self.known, self.drawn)).reshape(self.size, self.size)


def _bilinear(down: Float[np.ndarray, "n"], across: Float[np.ndarray, "n"]) -> Float[np.ndarray, "4 n"]:
    """How much of the values at the top left, top right, bottom left and bottom right is there; shares of a cell."""
    return np.stack([(1 - down) * (1 - across), (1 - down) * across, down * (1 - across), down * across])
