"""Lines cut into cells: which cells a line lies in, where in each, and how much each counts.

Letters: k the axis along which a direction v is longest, τ = -p_k/v_k where the line p + τ v meets the middle plane
x_k = 0 of the box, whose centre is the origin; y = p + τ v there (two numbers), s = v/|v_k| (two numbers); z the way
along k from the side of the box that faces back, so that d = t_0 + z/|v_k| with t_0 = τ - c_k/|v_k| and c the box's
upper corner. The six pairs of k and the sign of v_k are slabs. In each, the four numbers (y, s) are cut into equal
intervals, of which the outermost go on for ever; a cell is one interval of each.

A line near a border lies in the cells of both sides. Their weights add up to one and have continuous derivatives: in y
and s w = S(1/2 + x/2h) with x the way from the border in widths of a cell, h half the width of the band; from slab to
slab w_k = u_k/Σ u with u_k = S(1 + (|v_k|/max |v| - 1)/b). S(x) = 3 x² - 2 x³ on [0, 1].
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

AXES, SIDES = 3, 4  # of space; numbers of a line in a slab
REACH = 0.5  # slope of the lines for which y is cut: those of a slab have 0 to 1


@dataclass(frozen=True)
class CellLayout:
    """places, slopes: intervals of each y, of each s. half_band: h. slab_band: b."""

    places: int
    slopes: int
    half_band: float
    slab_band: float

    @property
    def counts(self) -> tuple[int, ...]:
        """Intervals of the four numbers."""
        return (self.places, self.places, self.slopes, self.slopes)

    @property
    def cells(self) -> int:
        """Of a slab; there are six slabs."""
        return self.places**2 * self.slopes**2


@dataclass(frozen=True)
class Pairs:
    """A line and a cell in which it lies, m times.

    rows: of the line. cells: which. local: (y, s) from -1 to 1 in the cell, beyond in a band. weights: of one line
    they add up to 1. before, rate: t_0 and 1/|v_k|.
    """

    rows: Int[Tensor, "m"]
    cells: Int[Tensor, "m"]
    local: Float[Tensor, "4 m"]
    weights: Float[Tensor, "m"]
    before: Float[Tensor, "m"]
    rate: Float[Tensor, "m"]


def pairs(
    p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"], layout: CellLayout, upper: tuple[float, float, float]
) -> Pairs:
    """Of all lines, slab after slab; a line has one pair at least, and differentiable weights and coordinates."""
    lines = torch.cat((p, v), dim=-1).T.contiguous()
    long = lines[AXES:].abs()
    longest = torch.maximum(torch.maximum(long[0], long[1]), long[2])
    u = _smooth((1 + (long / longest - 1) / layout.slab_band).clamp(min=0))
    share = u / (u[0] + u[1] + u[2])
    found = []
    for k in range(AXES):
        belongs, ahead = u[k] > 0, lines[AXES + k] > 0
        for forwards in (False, True):
            rows = torch.nonzero(belongs & (ahead if forwards else ~ahead)).squeeze(-1)
            if len(rows):
                part = _of_slab(lines.index_select(1, rows), (k, forwards), layout, upper)
                whole = share[k].index_select(0, rows).index_select(0, part.rows)
                found.append((rows.index_select(0, part.rows), part.weights * whole, part))
    rows, weights, parts = zip(*found, strict=True)
    return Pairs(
        torch.cat(rows),
        torch.cat([part.cells for part in parts]),
        torch.cat([part.local for part in parts], dim=1),
        torch.cat(weights),
        torch.cat([part.before for part in parts]),
        torch.cat([part.rate for part in parts]),
    )


def _of_slab(
    lines: Float[Tensor, "6 m"], slab: tuple[int, bool], layout: CellLayout, upper: tuple[float, float, float]
) -> Pairs:
    """Of lines of one slab: first each in the cell that it is in, then in those of which it touches the bands."""
    k, forwards = slab
    a, b = (k + 1) % AXES, (k + 2) % AXES
    rate = lines[AXES + k].abs().reciprocal()
    middle = -lines[k] / lines[AXES + k]
    along = lines[AXES + a], lines[AXES + b]
    numbers = torch.stack(
        (lines[a] + middle * along[0], lines[b] + middle * along[1], along[0] * rate, along[1] * rate)
    )
    counts = numbers.new_tensor(layout.counts)[:, None]
    reach = numbers.new_tensor([upper[a] + REACH * upper[k], upper[b] + REACH * upper[k], 1.0, 1.0])[:, None]
    at = numbers * (counts / (2 * reach)) + counts / 2
    index = torch.minimum(at.detach().floor().clamp_(min=0), counts - 1)
    at = at - index
    step = 2 * (at >= 0.5).to(at) - 1  # to the cell behind the nearest border
    way = ((at - 0.5).abs() - 0.5).abs()
    beside = index + step
    banded = (way < layout.half_band) & (beside >= 0) & (beside < counts)
    other = _smooth((0.5 - way / (2 * layout.half_band)).clamp(min=0)) * banded
    stride = index.new_tensor([layout.cells // layout.places ** (d + 1) for d in range(2)] + [layout.slopes, 1])
    cells = stride @ index + (2 * k + forwards) * layout.cells
    own = 1 - other
    rows, turned = _also(banded)
    moved = step.index_select(1, rows) * turned
    weights = torch.where(turned, other.index_select(1, rows), own.index_select(1, rows))
    local = 2 * at - 1
    every = torch.cat((torch.arange(lines.shape[1]), rows))
    before = middle - upper[k] * rate
    return Pairs(
        every,
        torch.cat((cells, cells.index_select(0, rows) + stride @ moved)).long(),
        torch.cat((local, local.index_select(1, rows) - 2 * moved), dim=1),
        torch.cat((_product(own), _product(weights))),
        before.index_select(0, every),
        rate.index_select(0, every),
    )


def _also(banded: Bool[Tensor, "4 m"]) -> tuple[Int[Tensor, "e"], Bool[Tensor, "4 e"]]:
    """Lines that lie in another cell besides, once for each, and in which numbers that cell is the one beside."""
    rows = torch.zeros(0, dtype=torch.int64)
    code = rows
    for side in range(SIDES):
        new = torch.nonzero(banded[side]).squeeze(-1)
        again = torch.nonzero(banded[side].index_select(0, rows)).squeeze(-1)
        bit = 1 << side
        code = torch.cat((code, code.index_select(0, again) + bit, torch.full_like(new, bit)))
        rows = torch.cat((rows, rows.index_select(0, again), new))
    bits = torch.tensor([[bool(code >> side & 1) for code in range(1 << SIDES)] for side in range(SIDES)])
    return rows, bits.index_select(1, code)


def _product(values: Float[Tensor, "4 m"]) -> Float[Tensor, "m"]:
    return (values[0] * values[1]) * (values[2] * values[3])


def _smooth(x: Tensor) -> Tensor:
    return x * x * (3 - 2 * x)
