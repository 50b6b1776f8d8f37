"""`ddf.torch.Field`: its answers are those of queries, its gradients those of differences and of closed forms."""

import _models
import numpy as np
import pytest
import torch
from _shapes import cube, icosphere, moved, towards
from torch.nn import functional

import ddf
from ddf.api.field import Field
from ddf.core import checks
from ddf.fields import shape_field
from ddf.fields.grid import octree
from ddf.fit import patch_fitting
from ddf.geometry import transforms

TURNED = transforms.Similarity(0.5, np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]), np.array([0.1, -0.2, 0.3]))


def _network() -> ddf.torch.Field:
    side = np.array([1.0, 0.7, 0.8])
    return ddf.torch.Field(shape_field.ShapeField(_models.field(), -side, side, TURNED, {})).double()


def _patches(mesh, soft: float | None = 0.0) -> ddf.torch.Field:
    return ddf.torch.Field(Field(patch_fitting.patches(mesh, octree.PatchConfig(1e-3))), soft)


def _towards(count: int, spread: float = 0.5) -> list[torch.Tensor]:
    return [torch.from_numpy(each) for each in towards(count, 5, spread)]


@pytest.mark.parametrize("name", ["network", "patches"])
def test_answers_are_those_of_a_query_for_any_batch_shape_and_both_types(name):
    mesh = moved(icosphere(3), np.array([1.0, 2.0, 0.5]), (1.0, 0.0, 0.0))
    field = ddf.load("rabbit-network") if name == "network" else ddf.fit(mesh, tolerance=1e-3)
    module, (starts, ways) = ddf.torch.Field(field, soft=0.0), _towards(60, spread=1.5)
    expected = field.query(starts.numpy(), ways.numpy(), ("visibility", "depth", "normals"))
    for kind, tolerance in ((torch.float64, 3e-6), (torch.float32, 2e-5)):
        found = module(*(each.reshape(3, 4, 5, 3).to(kind) for each in (starts, ways)))
        assert found.depth.shape == (3, 4, 5) and found.normals.dtype == kind
        visible = found.visibility.detach().reshape(-1).double().numpy()
        np.testing.assert_allclose(visible, expected["visibility"], atol=10 * tolerance)
        seen = np.isfinite(expected["depth"])
        assert 5 < seen.sum() < 60
        depth, normals = (each.detach().reshape(60, -1).double().numpy()[seen] for each in (found.depth, found.normals))
        np.testing.assert_allclose(depth[:, 0], expected["depth"][seen], atol=10 * tolerance)
        np.testing.assert_allclose(normals, expected["normals"][seen], atol=1e3 * tolerance)
        np.testing.assert_allclose(found.weights.detach().sum(-1).reshape(-1)[seen], 1, atol=1e-6)
    for shape in ((), (0,), (4, 3)):
        found = ddf.torch.Field(field)(torch.zeros(*shape, 3).requires_grad_(), ways[0].float())
        assert found.depth.shape == shape == found.depths.shape[:-1]
        found.depths.sum().backward()


def test_network_gradients_first_and_second_are_differences():
    field, (starts, ways) = _network(), _towards(6, spread=0.3)
    pose = torch.eye(4, dtype=torch.float64) + 0.05 * torch.from_numpy(np.random.default_rng(1).random((4, 4)))
    pose[3] = torch.tensor([0.0, 0, 0, 1])

    def said(p, v, rows):
        found = field(p, v, torch.cat([rows, pose[3:]]))
        assert found.depth.isfinite().all()
        return found.visibility, found.depth, found.depths, found.weights, found.normals

    inputs = tuple(each.clone().requires_grad_() for each in (starts, ways, pose[:3]))
    assert torch.autograd.gradcheck(said, inputs, eps=1e-5, atol=1e-6, rtol=1e-6)
    assert torch.autograd.gradgradcheck(lambda *each: said(*each)[:4], inputs, eps=1e-5, atol=1e-6, rtol=1e-6)


def test_gradients_of_a_networks_parameters_are_differences_and_the_field_itself_is_left_alone():
    field, (starts, ways) = _network(), _towards(20, spread=0.3)
    weight = field.get_parameter("_ask.field.network.head.weight")
    (slope,) = torch.autograd.grad(field(starts, ways).depth.sum(), weight)
    ends = []
    for step in (1e-5, -2e-5):
        with torch.no_grad():
            weight[1, 3] += step
        ends.append(float(field(starts, ways).depth.detach().sum()))
    assert (ends[0] - ends[1]) / 2e-5 == pytest.approx(float(slope[1, 3]), abs=1e-6)
    assert not any(each.requires_grad for each in _models.field().parameters())


def test_gradients_of_a_latent_are_differences():
    chairs, (starts, ways) = ddf.torch.Field.of_model("chair").double(), _towards(5, spread=0.2)
    latent = torch.tensor([0.3, -0.5, 0.2], dtype=torch.float64, requires_grad=True)

    def said(u):
        return chairs(starts, ways, latent=u)[:4]

    assert torch.autograd.gradcheck(said, (latent,), eps=1e-5, atol=1e-6, rtol=1e-6)
    mean = chairs(starts, ways).depth
    torch.testing.assert_close(chairs(starts, ways, latent=0 * latent).depth, mean)
    assert not torch.allclose(chairs(starts, ways, latent=latent).depth, mean)


def test_depths_of_a_cube_have_the_gradients_of_planes():
    field, (starts, ways) = _patches(cube()), _towards(200, spread=0.9)
    starts.requires_grad_()
    ways.requires_grad_()
    found = field(starts, ways)
    seen = found.depth.isfinite()
    n, v = found.normals.detach()[seen], ways.detach()[seen]
    assert seen.sum() > 100 and (n.abs().amax(-1) > 1 - 1e-4).all()
    first = torch.autograd.grad(found.depth[seen].sum(), (starts, ways), create_graph=True)
    slope = -n / (n * v).sum(-1, keepdim=True)  # Properties II and III
    torch.testing.assert_close(first[0][seen].detach(), slope, rtol=0, atol=1e-9)
    torch.testing.assert_close(first[1][seen].detach(), found.depth.detach()[seen, None] * slope, rtol=0, atol=1e-8)
    second = torch.autograd.grad((first[0][seen] * v).sum(), ways)[0][seen]  # of -n · v / (n · w) in w, at v
    torch.testing.assert_close(second, -slope, rtol=0, atol=1e-8)


def test_gradients_of_curved_patches_are_differences_and_nearly_those_of_the_sphere():
    field, (starts, ways) = _patches(icosphere(4)), _towards(300)
    tree, random = field._ask.soft.field, np.random.default_rng(3)
    step = 1e-5 * torch.from_numpy(random.standard_normal((2, 300, 3)))

    def which(p, v):
        back = tree.field_from_mesh
        return tree.met(back.apply(p.numpy()), v.numpy())[:, 7]

    ends = [(starts + sign * step[0], functional.normalize(ways + sign * step[1], dim=-1)) for sign in (1, -1)]
    inside = torch.from_numpy((which(*ends[0]) == which(*ends[1])) & (which(*ends[0]) == which(starts, ways)))
    starts, ways = starts[inside].requires_grad_(), ways[inside].requires_grad_()
    ends = [tuple(each[inside].detach().requires_grad_() for each in pair) for pair in ends]

    def first(p, v):
        return torch.autograd.grad(field(p, v).depth.sum(), (p, v), create_graph=True)

    by = [(one - other).detach() for one, other in zip(*ends, strict=True)]
    difference = (field(*ends[0]).depth - field(*ends[1]).depth).detach() / 2e-5
    slopes, normals = first(starts, ways), field(starts, ways).normals
    along = torch.stack([(slope * each).sum(-1) for slope, each in zip(slopes, by, strict=True)]).sum(0) / 2e-5
    assert inside.sum() > 150
    torch.testing.assert_close(along.detach(), difference, rtol=1e-6, atol=1e-6)
    exact = -normals / (normals * ways).sum(-1, keepdim=True)
    torch.testing.assert_close(slopes[0], exact, rtol=1e-7, atol=1e-9)
    hits = (starts + field(starts, ways).depth[:, None] * ways).detach()
    ball = -hits / (hits * ways.detach()).sum(-1, keepdim=True)
    assert (slopes[0].detach() - ball).norm(dim=-1).median() < 0.05
    there = torch.from_numpy(random.standard_normal(slopes[0].shape))
    bends = torch.autograd.grad((slopes[0] * there).sum(), (starts, ways))
    turned = torch.stack([(bend * each).sum(-1) for bend, each in zip(bends, by, strict=True)]).sum(0) / 2e-5
    changed = ((first(*ends[0])[0] - first(*ends[1])[0]).detach() * there).sum(-1) / 2e-5
    torch.testing.assert_close(turned, changed, rtol=1e-5, atol=1e-5)


def test_a_pose_moves_the_field_as_its_inverse_moves_the_rays_and_has_finite_gradients():
    field, (starts, ways) = _patches(icosphere(2), None), _towards(80, spread=1.6)
    matrix = torch.from_numpy(TURNED.to_matrix()).requires_grad_()
    placed = (torch.from_numpy(TURNED.apply(starts.numpy())), torch.from_numpy(TURNED.apply_directions(ways.numpy())))
    there, here = field(*placed, matrix), field(starts, ways)
    torch.testing.assert_close(there.visibility.detach(), here.visibility)
    torch.testing.assert_close(there.depth.detach(), 0.5 * here.depth)
    assert 0 < here.depth.isfinite().sum() < 80
    (slope,) = torch.autograd.grad(there.depth[there.depth.isfinite()].sum() + there.visibility.sum(), matrix)
    assert slope.isfinite().all() and (slope[:3] != 0).all()


def test_soft_edges_fall_from_one_to_zero_and_push_a_silhouette():
    field = _patches(cube(), 0.2)
    x = torch.linspace(0.5, 1.5, 201, dtype=torch.float64)
    starts = torch.stack((x, torch.full_like(x, 0.1), torch.full_like(x, 3.0)), -1).requires_grad_()
    found = field(starts, torch.tensor([[0.0, 0, -1]], dtype=torch.float64).expand(201, 3))
    ends = found.visibility.detach()[[0, -1]].numpy()
    np.testing.assert_allclose(ends, [1, 0], atol=1e-9)
    (slope,) = torch.autograd.grad(found.visibility.sum(), starts)
    assert np.trapezoid(slope[:, 0].numpy(), x.numpy()) == pytest.approx(-1, abs=0.05)
    torch.testing.assert_close(found.weights.sum(-1)[0], torch.ones(()).double())
    assert found.weights.detach()[-1].sum() == 0 and found.depth.detach()[-1] == torch.inf


def test_what_is_no_field_and_no_radius_is_told():
    with pytest.raises(checks.InputError, match="give a field of"):
        ddf.torch.Field(3)
    with pytest.raises(checks.InputError, match="soft must be a radius"):
        _patches(cube(), -0.1)
    field, starts, ways = _patches(cube()), torch.zeros(4, 3), torch.eye(3)[[0, 1, 2, 0]]
    for given, told in (
        ((starts[:2], ways), "must fit each other"),
        ((starts + torch.nan, ways), "positions must be finite"),
        ((starts, 2 * ways), "directions must be unit length"),
        ((starts, ways, torch.ones(4, 4).triu() - torch.eye(4, 4).roll(1, 1).triu()), "pose must"),
        ((starts, ways, None, torch.zeros(3)), "none of one shape"),
    ):
        with pytest.raises(checks.InputError, match=told):
            field(*given)
