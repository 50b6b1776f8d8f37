"""Hard clouds drawn from a field: candidates that cancel or see nothing, starts between sheets and on the surface."""

import pytest
import torch
from _hard import SATURATED, assert_exact, assert_within, constant_field, step

from ddf.fields import cloud_projection, pddf, udf

PAPER = cloud_projection.CloudConfig(64, 3, 0.0, (), None, 0.05, 0.01)
X, Y = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]
MINUS_X = [-1.0, 0.0, 0.0]


class TwoSheets(pddf.PDDF):
    """The exact field of the planes x = ±1/2, seen from between them; all visible."""

    def __init__(self):
        super().__init__(pddf.PDDFConfig((4,), 1.0, 1.0, "relu", 1.0))

    def forward(self, positions, directions, modulations=None):
        """Depth (±1/2 - p_x)/v_x, the sign that of v_x; nothing is modulated."""
        del modulations
        x, v = positions[..., 0], directions[..., 0]
        depth = (torch.where(v >= 0, 0.5, -0.5).to(x) - x) / torch.where(v == 0, torch.finfo(v.dtype).eps, v)
        return torch.stack((depth, depth, torch.ones_like(depth), torch.full_like(depth, 20.0)), dim=-1)


def _closest(candidates, visibility, depth, dtype, temperature=PAPER.temperature, inverse_depth=PAPER.inverse_depth):
    """v̂* of one point."""
    at, seen, far = (torch.tensor([values], dtype=dtype) for values in (candidates, visibility, depth))
    return udf.closest_directions(at, seen, far, temperature, inverse_depth)[0]


@pytest.mark.parametrize(
    ("visibility", "far"),
    [pytest.param(1.0, 2.0, id="1e-13"), pytest.param(0.999, 2.0, id="0.02x"), pytest.param(1.0, 0.545, id="0.02y")],
)
def test_of_candidates_that_cancel_the_heaviest_is_taken(visibility, far, dtype):
    """±x at depth 1/2 and y: never what rounding or a far surface leaves of the weighted mean, so long as the id."""
    found = _closest([X, MINUS_X, Y], [1.0, visibility, 1.0], [0.5, 0.5, far], dtype)
    assert_exact(found.abs(), X)
    if visibility < 1:
        assert_exact(found, X)


def test_candidates_that_nearly_cancel_give_their_mean(dtype):
    """±x with visibilities 1 and 0.99, y 1e6 away: the mean is 0.19 long, above the limit of 0.05."""
    assert_within(_closest([X, MINUS_X, Y], [1.0, 0.99, 1.0], [0.5, 0.5, 1e6], dtype), X, step(dtype))


def test_invisible_candidates_weigh_the_same(dtype):
    assert_within(_closest([X, Y], [0.0, 0.0], [0.3, 0.6], dtype), [0.5**0.5, 0.5**0.5, 0.0], 2 * step(dtype))


def test_depth_zero_at_a_tiny_temperature_does_not_overflow(dtype):
    assert_exact(_closest([X, Y], [1.0, 1.0], [0.0, 1e-3], dtype, 1e-4, 1e-6), X)


@pytest.mark.parametrize("x", [0.0, 0.5])
def test_points_between_two_sheets_and_on_one_land_on_a_sheet(x, dtype):
    """Half-way the mean of 64 candidates nearly cancels; on a sheet they stay or cross to the other."""
    generator = torch.Generator().manual_seed(0)
    start = torch.rand(200, 3, generator=generator, dtype=dtype) - 0.5
    start[:, 0] = x
    found = cloud_projection.project(TwoSheets(), None, start, PAPER, generator).points
    way = (found - start).norm(dim=-1).double()
    assert_within(found[:, 0].abs(), torch.full((200,), 0.5), 4 * step(dtype) * (1 + way))


def test_a_field_that_sees_nothing_gives_a_finite_cloud(dtype):
    field = constant_field((0.3, 0.3, 9, -SATURATED), dtype)
    cycles = cloud_projection.sample(field, None, 20, PAPER, torch.Generator().manual_seed(0))
    (points,) = cloud_projection.select(cycles, [20], PAPER)
    assert points.shape == (20, 3)
    assert torch.isfinite(points).all()
    assert_exact(cycles[-1].visibility, torch.zeros(22))


def test_clouds_of_one_point_and_of_one_place(dtype):
    points = torch.tensor([[0.1, 0, 0], [0.2, 0, 0]], dtype=dtype)
    seen = torch.tensor([0.2, 0.9], dtype=dtype)
    (kept,) = cloud_projection.select([cloud_projection.ProjectedPoints(points, seen, seen)], [1], PAPER)
    assert_exact(kept, points[1:])
    assert_exact(cloud_projection.farthest_point_order(torch.ones(5, 3, dtype=dtype), 5), [0] * 5)
