"""Lines cut into cells: where they lie, weights that add up to one and change smoothly across every border."""

import itertools

import pytest
import torch
from torch.nn import functional

from bench.rivals import cells

LAYOUT, UPPER = cells.CellLayout(3, 2, 0.08, 0.15), (0.7, 1.0, 0.5)


def _lines(count: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Outside the box, towards points in it; float64."""
    random = torch.Generator().manual_seed(0)
    v = functional.normalize(torch.randn(count, 3, generator=random).double(), dim=-1)
    aims = torch.tensor(UPPER) * (2 * torch.rand(count, 3, generator=random).double() - 1)
    return aims - 3 * v, v


def _plainly(p: torch.Tensor, v: torch.Tensor) -> dict[int, tuple[float, list[float], float, float]]:
    """Of one line, in loops over slabs and cells: of each cell weight, coordinates, t_0 and 1/|v_k|."""

    def smooth(x: float) -> float:
        x = min(max(x, 0.0), 1.0)
        return 3 * x**2 - 2 * x**3

    longest = max(abs(float(x)) for x in v)
    shares = [smooth(1 + (abs(float(x)) / longest - 1) / LAYOUT.slab_band) for x in v]
    found = {}
    for k in (k for k in range(3) if shares[k] > 0):
        a, b = [(1, 2), (2, 0), (0, 1)][k]
        rate, middle = 1 / abs(float(v[k])), float(-p[k] / v[k])
        point = p + middle * v
        numbers = [float(point[a]), float(point[b]), float(v[a]) * rate, float(v[b]) * rate]
        reach = [UPPER[a] + UPPER[k] / 2, UPPER[b] + UPPER[k] / 2, 1, 1]
        for place in itertools.product(*(range(n) for n in LAYOUT.counts)):
            weight, local = shares[k] / sum(shares), []
            for index, number, far, count in zip(place, numbers, reach, LAYOUT.counts, strict=True):
                at = (number / far + 1) * count / 2
                if index > 0:
                    weight *= smooth(0.5 + (at - index) / (2 * LAYOUT.half_band))
                if index < count - 1:
                    weight *= smooth(0.5 - (at - index - 1) / (2 * LAYOUT.half_band))
                local.append(2 * (at - index) - 1)
            if weight > 0:
                name = 2 * k + int(v[k] > 0)
                for index, count in zip(place, LAYOUT.counts, strict=True):
                    name = name * count + index
                found[name] = (weight, local, middle - UPPER[k] * rate, rate)
    return found


def test_pairs_are_those_of_a_plain_loop():
    p, v = _lines(400)
    found = cells.pairs(p, v, LAYOUT, UPPER)
    told = [{} for _ in p]
    for at, (row, cell) in enumerate(zip(found.rows.tolist(), found.cells.tolist(), strict=True)):
        assert cell not in told[row]
        told[row][cell] = at
    several = 0
    for row in range(len(p)):
        truth = {cell: value for cell, value in _plainly(p[row], v[row]).items() if value[0] > 1e-12}
        kept = {cell: at for cell, at in told[row].items() if float(found.weights[at]) > 1e-12}
        assert truth.keys() == kept.keys()
        several += len(truth) > 1
        for cell, at in kept.items():
            weight, local, before, rate = truth[cell]
            mine = torch.cat(
                (found.weights[at, None], found.local[:, at], found.before[at, None], found.rate[at, None])
            )
            torch.testing.assert_close(
                mine, torch.tensor([weight, *local, before, rate], dtype=torch.float64), rtol=1e-9, atol=1e-9
            )
    assert 100 < several < 400


def test_weights_of_a_line_add_up_to_one_and_cells_exist():
    p, v = _lines(5_000)
    found = cells.pairs(p, v, LAYOUT, UPPER)
    whole = torch.zeros(len(p)).double().index_add(0, found.rows, found.weights)
    torch.testing.assert_close(whole, torch.ones_like(whole))
    assert int(found.cells.min()) >= 0 and int(found.cells.max()) < 6 * LAYOUT.cells


def test_depth_is_counted_from_the_side_of_the_box_that_faces_back():
    p, v = _lines(300)
    found = cells.pairs(p, v, LAYOUT, UPPER)
    starts = p[found.rows] + found.before[:, None] * v[found.rows]
    k = (1 / found.rate[:, None] - v[found.rows].abs()).abs().argmin(-1, keepdim=True)
    side = -torch.tensor(UPPER).double()[k] * v[found.rows].gather(1, k).sign()
    torch.testing.assert_close(starts.gather(1, k), side)


@pytest.mark.parametrize("moves", ["place", "direction"])
def test_what_constants_say_together_changes_smoothly(moves):
    """A sum of one number of each cell by the weights: its steps on a path through many cells are as a smooth one's."""
    said = torch.rand(6 * LAYOUT.cells, generator=torch.Generator().manual_seed(1)).double()

    def largest_second_difference(count: int) -> tuple[float, float]:
        t = torch.linspace(0, 1, count).double()[:, None]
        p = torch.tensor([[-2.0, 0.3, 0.2]]).double() + (
            t * torch.tensor([[0.0, -0.9, -0.6]]) if moves == "place" else 0
        )
        v = torch.tensor([[1.0, 0.1, 0.05]]) + (t * torch.tensor([[-0.6, 0.8, 0.9]]) if moves == "direction" else 0)
        v = functional.normalize(v.double(), dim=-1)
        p, v = (part.expand(count, 3) for part in (p, v))
        found = cells.pairs(p, v, LAYOUT, UPPER)
        value = torch.zeros(count).double().index_add(0, found.rows, found.weights * said[found.cells])
        assert len(torch.unique(found.cells)) > 4
        return float(value.diff().abs().max()), float(value.diff().diff().abs().max())

    first, second = zip(*(largest_second_difference(count) for count in (4_001, 8_001)), strict=True)
    assert first[0] > 1e-4
    assert first[0] / first[1] == pytest.approx(2, rel=0.1)  # no jump
    assert second[0] / second[1] == pytest.approx(4, rel=0.4)  # nor one of the derivative
