import _models
import pytest
import torch

from ddf.core import checks
from ddf.fields import curvature, field_outputs, rendering


@pytest.mark.parametrize("activation", ["relu", "softplus"])
def test_outputs_are_those_of_rendering(activation):
    field = _models.field(activation)
    positions, directions = _models.points(200)
    values = field_outputs.FieldValues(field, positions, directions, None)
    expected = rendering.query(field, positions, directions, None, rendering.OUTPUTS)
    for name, value in expected.items():
        torch.testing.assert_close(field_outputs.OUTPUTS[name].compute(values), value, msg=name)
    weights = field_outputs.OUTPUTS["weights"].compute(values)
    torch.testing.assert_close(weights[:, 0], torch.sigmoid(field(positions, directions)[:, 2]))
    torch.testing.assert_close(weights.sum(-1), torch.ones(200))


def test_curvatures_are_those_of_the_curvature_module():
    field = _models.field()
    values = field_outputs.FieldValues(field, *_models.points(50), None)
    surface = curvature.surface(field, *_models.points(50))
    assert surface.mean is not None and surface.gaussian is not None
    torch.testing.assert_close(field_outputs.OUTPUTS["mean_curvature"].compute(values), surface.mean)
    torch.testing.assert_close(field_outputs.OUTPUTS["gaussian_curvature"].compute(values), surface.gaussian)
    assert float(surface.mean.abs().max()) > 1e-3


def test_component_is_unclear_where_both_are_equally_heavy():
    field = _models.field("softplus")
    with torch.no_grad():
        field.network.head.weight[2] = 0
        field.network.head.bias[2] = 0
    values = field_outputs.FieldValues(field, *_models.points(5), None)
    assert not values.component_is_clear().any()
    assert not values.normal_is_clear().any()
    assert values.everywhere().all()


def test_normal_is_unclear_where_the_ray_grazes_and_nowhere_else():
    field = _models.field()
    with torch.no_grad():
        field.network.head.bias[2] = 50.0  # the first component everywhere
    positions, directions = _models.points(20_000)
    positions.requires_grad_()
    (gradient,) = torch.autograd.grad(field(positions, directions)[:, 0].sum(), positions)
    cosine = torch.nn.functional.cosine_similarity(gradient, directions).abs()
    clear = field_outputs.FieldValues(field, positions.detach(), directions, None).normal_is_clear()
    assert int((cosine < 0.9e-3).sum()) > 5
    assert not clear[cosine < 0.9e-3].any()
    assert clear[(cosine > 1.1e-3) & (gradient.norm(dim=-1) > 2e-3 * gradient.norm(dim=-1).amax())].all()


@pytest.mark.parametrize("outputs", [(), ("depth", "depth"), ("depth", "colour")])
def test_outputs_that_do_not_exist_are_refused(outputs):
    with pytest.raises(checks.InputError, match="outputs must be one or more of visibility, depth, normals, weights"):
        field_outputs.require_outputs(outputs)
