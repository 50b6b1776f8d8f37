"""Exact depth images of closed forms obey both properties to rounding; images of something else do not."""

import pytest
import torch
from _support import assert_close

from ddf.fields import derivatives
from ddf.fields.renderers import image_properties
from ddf.geometry import cameras, primitives

SIZE = 8
CENTRE = (0.1, 0.0, -0.05)
NORMAL, HEIGHT = torch.nn.functional.normalize(torch.tensor([0.3, 1.0, 0.2]).double(), dim=0), -0.4


def _views():
    axes, centre = cameras.extrinsics(*(torch.tensor([value], dtype=torch.float64) for value in (0.6, 0.5, 2.6)))
    return image_properties.Views(centre, axes)


def _sphere(positions, directions):
    return primitives.Sphere(CENTRE, 0.8).first(positions, directions)[0]


def _plane(positions, directions):
    return (HEIGHT - positions @ NORMAL) / (directions @ NORMAL)


def _turn(by):
    """exp([ω]_×)."""
    zero = torch.zeros_like(by[0])
    rows = [zero, -by[2], by[1], by[2], zero, -by[0], -by[1], by[0], zero]
    return torch.linalg.matrix_exp(torch.stack(rows).reshape(3, 3))


def _exact(surface):
    """Directions, depths and their derivatives by autograd, where the surface is seen."""
    views = _views()
    seen = torch.isfinite(surface(views.positions.expand(SIZE**2, 3), views.directions(SIZE).reshape(-1, 3)))

    def depths(moved, turned):
        now = image_properties.Views(views.positions + moved, views.axes @ _turn(turned).T)
        return surface(now.positions.expand(SIZE**2, 3)[seen], now.directions(SIZE).reshape(-1, 3)[seen])

    zero = torch.zeros(3, dtype=torch.float64)
    by_move, by_turn = torch.autograd.functional.jacobian(depths, (zero, zero))
    assert seen.sum() > 20
    shaped = [values[None, None] for values in (depths(zero, zero), by_move, by_turn)]
    return views.directions(SIZE).reshape(-1, 3)[seen][None, None], *shaped


@pytest.mark.parametrize("surface", [_sphere, _plane])
def test_exact_images_obey_both_properties(surface):
    directions, depth, moved, turned = _exact(surface)
    assert_close(image_properties.eikonal(moved, directions), torch.zeros_like(depth), atol=1e-10)
    mismatch = image_properties.gradient_consistency(depth, moved, turned, directions)
    assert_close(mismatch, torch.zeros_like(turned), atol=1e-10)
    along, across = image_properties.loss(torch.ones_like(depth).bool(), depth, moved, turned, directions)
    assert float(along) < 1e-20 and float(across) < 1e-20
    _, wrong = image_properties.loss(torch.ones_like(depth).bool(), depth, moved, 1.1 * turned, directions)
    assert float(wrong) > 1e-4


def test_normals_of_exact_images_are_those_of_the_surface():
    directions, depth, moved, _ = _exact(_sphere)
    points = _views().positions + depth[..., None] * directions
    outward = torch.nn.functional.normalize(points - torch.tensor(CENTRE, dtype=torch.float64), dim=-1)
    assert_close(derivatives.normals(moved, directions), outward)
    directions, _, moved, _ = _exact(_plane)
    assert_close(derivatives.normals(moved, directions), NORMAL.expand_as(directions))


def test_loss_is_the_mean_square_over_all_pixels_of_the_visible_ones():
    generator = torch.Generator().manual_seed(0)
    directions, moved, turned = (torch.randn((2, 3, 3, 3), generator=generator).double() for _ in range(3))
    depth = 1 + torch.rand((2, 3, 3), generator=generator).double()
    visible = depth > 1.4
    along = across = 0.0
    for index in visible.nonzero().tolist():
        d, p, w, v = (values[tuple(index)] for values in (depth, moved, turned, directions))
        along += float((p @ v + 1) ** 2)
        across += float(((w / d - torch.linalg.cross(v, p)) ** 2).sum())
    found = image_properties.loss(visible, depth, moved, turned, directions)
    assert_close(torch.stack(found), torch.tensor([along, across], dtype=torch.float64) / visible.numel())
