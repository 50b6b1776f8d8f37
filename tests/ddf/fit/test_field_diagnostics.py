"""Diagnostics of a fitted field: zero for an exact DDF, and each one sees the fault that it is for."""

import _models
import numpy as np
import pytest
import torch
from _support import assert_close

from ddf.fields import pddf, shape_field
from ddf.fit import field_diagnostics
from ddf.geometry import primitives

SPHERE = primitives.Sphere((0.1, 0.0, -0.1), 0.7)


def _exact(positions, directions):
    depth, _ = SPHERE.first(positions, directions)
    visible = torch.isfinite(depth)
    return torch.where(visible, depth, 0.0), visible.double() + 0.0 * positions.sum(-1)


def _rays(count=400):
    generator = torch.Generator().manual_seed(0)
    p, v, other = (2 * torch.rand(count, 3, generator=generator, dtype=torch.float64) - 1 for _ in range(3))
    return p, torch.nn.functional.normalize(v, dim=-1), other


def test_an_exact_field_has_no_residuals():
    found = field_diagnostics.residuals(_exact, *_rays())
    assert tuple(found) == field_diagnostics.NAMES
    assert len(found["eikonal_visibility"]) == 400
    assert 100 < len(found["eikonal_depth"]) < 400
    for name, values in found.items():
        assert float(values.max()) < 1e-7, name


def _but(change):
    """The exact field with its depth and visibility changed."""
    return lambda p, v: change(p, v, *_exact(p, v))


_longer = _but(lambda p, v, depth, seen: (1.1 * depth, seen))
_turning = _but(lambda p, v, depth, seen: (depth + 0.2 * v[:, 0], seen))
_farther = _but(lambda p, v, depth, seen: (depth + 0.3, seen))
_fading = _but(lambda p, v, depth, seen: (depth, seen * (0.8 + 0.1 * (p * v).sum(-1))))


@pytest.mark.parametrize(
    ("answers", "name", "least", "untouched"),
    [
        (_longer, "eikonal_depth", 0.0999, "eikonal_visibility"),
        (_turning, "gradient_consistency", 0.01, "eikonal_depth"),
        (_farther, "view_depth", 0.0, "eikonal_depth"),
        (_fading, "eikonal_visibility", 0.0, "view_depth"),
        (_fading, "view_visibility", 0.01, "gradient_consistency"),
    ],
)
def test_each_residual_sees_its_own_fault_and_no_other(answers, name, least, untouched):
    found = field_diagnostics.residuals(answers, *_rays())
    assert float(found[name].median()) >= least
    assert float(found[name].max()) > 0.05
    assert float(found[untouched].max()) < 1e-7


def test_view_residuals_look_from_the_second_start():
    q = torch.tensor([[0.8, 0.0, -0.1], [0.8, 0.0, -0.1]], dtype=torch.float64)  # on the sphere, to the right
    starts = torch.tensor([[1.0, 0.0, -0.1], [-1.0, 0.0, -0.1]], dtype=torch.float64)
    whole = torch.tensor([True, True])
    depth, unseen = field_diagnostics.view_residuals(_farther, q, starts, whole)
    assert_close(depth, torch.tensor([0.3, 0.0], dtype=torch.float64))  # from the left something is before it
    assert_close(unseen, torch.zeros(2, dtype=torch.float64))
    first, _ = field_diagnostics.view_residuals(_farther, q, starts, ~whole)
    assert len(first) == 0


def test_a_field_is_measured_in_chunks_on_the_same_rays_for_a_seed(tmp_path, monkeypatch):
    shape = shape_field.load(_models.write_shape_field(tmp_path))
    whole = field_diagnostics.measure(shape, 100, seed=1)
    assert whole["eikonal_visibility"]["rays"] == 100 and whole != field_diagnostics.measure(shape, 100, seed=2)
    monkeypatch.setattr(field_diagnostics, "CHUNK_RAYS", 30)
    for name, values in field_diagnostics.measure(shape, 100, seed=1).items():
        assert values == pytest.approx(whole[name], rel=1e-4, abs=1e-6, nan_ok=True)
        assert not values["median"] > values["p95"] and not values["p95"] > values["worst"]


def test_residuals_of_a_field_that_sees_nothing_are_not_a_number(tmp_path):
    shape = shape_field.load(_models.write_shape_field(tmp_path))
    with torch.no_grad():
        shape.field.network.head.weight[pddf.VISIBILITY_ROW] = 0.0
        shape.field.network.head.bias[pddf.VISIBILITY_ROW] = -9.0
    found = field_diagnostics.measure(shape, 50)
    assert found["eikonal_depth"]["rays"] == found["view_depth"]["rays"] == 0
    for name in ("eikonal_depth", "gradient_consistency", "view_depth", "view_visibility"):
        assert np.isnan([found[name][key] for key in ("median", "p95", "worst")]).all(), name
    assert found["eikonal_visibility"]["rays"] == 50 and found["eikonal_visibility"]["worst"] >= 0
