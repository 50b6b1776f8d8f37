import _models
import pytest
import torch

from ddf.core import checks
from ddf.fields import derivatives, field_outputs, field_values, pddf


@pytest.mark.parametrize("activation", ["relu", "softplus"])
def test_each_output_alone_and_with_all_others_is_that_of_autograd(activation):
    field, (positions, directions) = _models.field(activation), _models.points(200)
    start = positions.clone().requires_grad_()
    raw = field(start, directions)
    chosen = (raw[:, 2:3] < 0).long()

    def normals(depth):
        (gradient,) = torch.autograd.grad(depth.sum(), start, retain_graph=True)
        return derivatives.normals(gradient, directions)

    expected = {
        "visibility": raw[:, -1].sigmoid(),
        "depth": field.depths(raw).gather(-1, chosen)[:, 0],
        "normals": normals(raw[:, :2].gather(-1, chosen)),
        "mean_curvature": derivatives.Surface(field, positions, directions).mean,
        "gaussian_curvature": derivatives.Surface(field, positions, directions).gaussian,
        "weight_1": raw[:, 2].sigmoid(),
        "normals_1": normals(raw[:, 0]),
        "normals_2": normals(raw[:, 1]),
    }
    together = field_values.evaluate(field, positions, directions, field_outputs.OUTPUTS)
    assert list(together) == list(expected)
    for name, value in expected.items():
        for found in (together, field_values.evaluate(field, positions, directions, [name])):
            torch.testing.assert_close(found[name], value, msg=name, rtol=1e-4, atol=1e-4)


def test_component_is_unclear_where_both_are_equally_heavy():
    field = _models.field("softplus")
    with torch.no_grad():
        field.network.head.weight[pddf.WEIGHT_ROW] = 0
        field.network.head.bias[pddf.WEIGHT_ROW] = 0
    values = field_values.FieldValues(field, *_models.points(5))
    assert not values.component_is_clear.any() and not values.normal_is_clear.any()
    assert values.everywhere.all() and values.component_normal_is_clear(1).any()


def test_normal_is_unclear_where_the_ray_grazes_and_nowhere_else():
    field = _models.field()
    with torch.no_grad():
        field.network.head.bias[pddf.WEIGHT_ROW] = 50.0  # the first component everywhere
    positions, directions = _models.points(20_000)
    positions.requires_grad_()
    (gradient,) = torch.autograd.grad(field(positions, directions)[:, 0].sum(), positions)
    cosine = torch.nn.functional.cosine_similarity(gradient, directions).abs()
    values = field_values.FieldValues(field, positions.detach(), directions)
    assert torch.equal(values.normal_is_clear, values.component_normal_is_clear(0))
    assert int((cosine < 0.9e-3).sum()) > 5
    assert not values.normal_is_clear[cosine < 0.9e-3].any()
    steep = gradient.norm(dim=-1) > 2e-3 * gradient.norm(dim=-1).amax()
    assert values.normal_is_clear[(cosine > 1.1e-3) & steep].all()


@pytest.mark.parametrize("asked", [(), ("depth", "depth"), ("depth", "colour"), ("weight_2",)])
def test_outputs_that_do_not_exist_are_refused(asked):
    with pytest.raises(checks.InputError, match="outputs must be among visibility, depth, normals, "):
        field_values.evaluate(_models.field(), *_models.points(1), asked)
