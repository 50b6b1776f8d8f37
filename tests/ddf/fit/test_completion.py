"""Completion of scans: likelihoods of mass one, priors, and poses and shapes found again."""

import dataclasses
import math

import _models
import _shapes
import numpy as np
import pytest
import torch

import ddf
from ddf.api.field import Field
from ddf.core import checks, shipped_models
from ddf.data.synthetic import showcase
from ddf.fields import pddf, shape_field
from ddf.fit import completed_surface, completion, latent_prior
from ddf.geometry import rays, scans, transforms
from ddf.models import out_of_distribution

PLACE = transforms.Similarity(0.4, np.eye(3), np.array([1.0, 0.2, -0.3]))
QUICK = completion.CompletionConfig(rays=200, draws=32, starts=2, kept=1, steps=40, samples=8)


def _turned(*vector):
    """The rotation about this axis by its length, in radians."""
    left, _, right = np.linalg.svd(completion.rotations(torch.tensor([vector]))[0].double().numpy())
    return left @ right


def _apart(found, place=PLACE):
    """Degrees between two poses, and the distance of their origins."""
    cosine = (np.trace(found.rotation.T @ place.rotation) - 1) / 2
    return math.degrees(math.acos(min(1.0, cosine))), np.linalg.norm(found.translation - place.translation)


def test_likelihood_of_a_ray_is_of_mass_one():
    raw = torch.tensor([[1.2, 0.7, 0.4, 0.9]], dtype=torch.float64)
    depths, width, through = torch.tensor([[0.5, 1.3]], dtype=torch.float64), 0.02, 2.0
    ranges = torch.linspace(0, through, 40_001, dtype=torch.float64)
    yes, no = torch.ones(1, dtype=torch.bool), torch.zeros(1, dtype=torch.bool)
    given = (torch.full((1,), through, dtype=torch.float64), yes, width, 0.1)
    met = completion.ray_log_likelihood(raw, depths, ranges[:, None], yes, *given).exp()[:, 0]
    missed = completion.ray_log_likelihood(raw, depths, torch.zeros(1, dtype=torch.float64), no, *given).exp()
    assert float(torch.trapezoid(met, ranges) + missed) == pytest.approx(1, abs=1e-5)
    visible = 1 / (1 + math.exp(-0.9))
    assert float(missed) == pytest.approx(0.9 * (1 - visible) + 0.05)
    first = 0.9 * visible / (1 + math.exp(-0.4)) / (2 * width) + 0.05 / through
    assert float(met[10_000]) == pytest.approx(first, rel=1e-6)


def test_a_larger_scale_earns_nothing_by_making_errors_small():
    model, prior, _ = _chair()
    problem, count, masses = completion._Problem(model, prior, 0.05, dataclasses.replace(QUICK, prior=0.0)), 2001, []
    for growth in (0.0, 0.4):  # one ray of the field, through the cube
        scale = math.exp(growth)
        shape = torch.zeros(count, 32), torch.zeros(count, 3), torch.zeros(count, 3), torch.full((count,), growth)
        ranges = torch.linspace(scale, 3 * scale, count)
        positions, directions = torch.tensor([0.1, 0.2, 2.0]) * scale, torch.tensor([0.0, 0.0, -1.0])
        seen = completion._Rays(positions.expand(count, 1, 3), directions.expand(count, 1, 3), ranges[:, None])
        with torch.no_grad():
            masses.append(float(torch.trapezoid((-problem.loss(completion._State(*shape), seen)).exp(), ranges)))
    assert masses[0] == pytest.approx(masses[1], rel=1e-3) and masses[0] > 0.1


def test_the_scale_is_tied_to_the_length_of_the_cube_that_hits_take_up():
    model, prior, shape = _chair()
    line = torch.linspace(-0.6, 0.6, 1001)[:, None] * torch.tensor([0.0, 1.0, 0.0]) + torch.tensor([0.3, 2.0, 0.1])
    problem = completion._Problem(model, prior, 0.05, QUICK, hits=line)
    turn, growth = torch.tensor([[0.0, 0, 0], [np.pi / 2, 0, 0], [0, 0, 0]]), torch.tensor([0.0, 0.0, 0.1])
    state = completion._State(torch.zeros(3, 32), turn, torch.zeros(3, 3), growth)
    length = 0.6 * (1 - 2 * completion._STRAY)
    wanted = (np.log(length / 0.87) - np.array([0, 0, 0.1])) / completion._TAKEN_OFF
    np.testing.assert_allclose(problem.untaken(state, line), wanted, atol=1e-4)
    free = dataclasses.replace(problem, hits=None)
    scan = _scan(shape, 24)
    seen = completion._evidence(scan, PLACE, torch.Generator(), prior.mean)
    with torch.no_grad():
        extra = problem.loss(state, seen) - free.loss(state, seen)
    np.testing.assert_allclose(extra, completion._TIE * wanted**2 / 2, rtol=1e-3)


def test_prior_has_mean_and_covariance_of_the_latents_of_training_images():
    model = _models.ddf_model()
    width = model.shape_encoder.fc.in_features
    features = torch.randn(50, width, generator=torch.Generator().manual_seed(0)) @ torch.diag(torch.rand(width) + 0.1)
    known = out_of_distribution.TrainingStatistics.of([features])
    prior = latent_prior.of(model, known).widest(100)
    with torch.no_grad():
        latents = model.shape_encoder.fc(features).double()
    weight = model.shape_encoder.fc.weight.detach().double()
    widened = out_of_distribution.WIDENED * features.double().var(dim=0).mean() * weight @ weight.T
    torch.testing.assert_close(prior.mean.double(), latents.mean(0), rtol=0, atol=1e-5)
    covariance = prior.basis.double() @ prior.basis.double().T
    torch.testing.assert_close(covariance, torch.cov(latents.T) + widened, rtol=0, atol=1e-5)
    u = torch.randn(3, prior.basis.shape[1])
    torch.testing.assert_close(prior.coordinates(prior.latents(u)), u, rtol=0, atol=1e-2)
    with pytest.raises(checks.InputError, match="does not say what its training images were like"):
        latent_prior.of(model, None)


def _chair():
    folder = shipped_models.place("chair")
    model, prior, _ = latent_prior.load(folder)
    prior = prior.widest(32)
    return model, prior, shape_field.in_cube(pddf.baked(model.field, _modulations(model, prior)), 0.4)


def _modulations(model, prior):
    """Of the shape of `_chair`."""
    latent = prior.latents(0.5 * torch.randn(32, generator=torch.Generator().manual_seed(4)))
    return [each[0].detach() for each in model.modulations(latent[None])]


def _scan(shape, size=40):
    """Of the field of a shape whose box is at `PLACE`."""
    at = dataclasses.replace(shape, field_from_mesh=PLACE.inverse())
    return ddf.depth_camera(Field(at), size=size)


def test_a_scan_of_a_field_gives_back_its_pose_and_shape():
    model, prior, shape = _chair()
    scan = _scan(shape)
    off = transforms.Similarity(1.05, _turned(0.0, math.radians(8), 0.0))
    start = dataclasses.replace(PLACE.compose(off), translation=PLACE.translation + 0.02)
    config = dataclasses.replace(QUICK, draws=64, steps=80)
    found = completion.complete(model, prior, scan, start, completion.Doubt(6.0, 0.05, 0.05), config=config)
    degrees, away = _apart(found.scan_from_field)
    assert degrees < 3 and abs(found.scan_from_field.scale / 0.4 - 1) < 0.02 and away < 0.02
    assert found.explained > 0.9 and np.nanmedian(np.abs(found.residuals)) < 0.005
    seen = completed_surface.cloud(model.field, found, scan, 400)
    assert 0.1 < seen.seen.mean() < 0.9 and np.isfinite(seen.spread).all()
    field = completed_surface.field(model.field, found)
    inside, looking = _models.points(50)
    plain, conditioned = field.field(inside, looking), model.field(inside, looking, found.modulations)
    torch.testing.assert_close(plain, conditioned, rtol=1e-4, atol=1e-4)


def test_the_known_pose_stays_and_the_same_seed_gives_the_same_shape():
    model, prior, shape = _chair()
    config = dataclasses.replace(QUICK, steps=6)
    one, other = (completion.complete(model, prior, _scan(shape, 24), PLACE, config=config) for _ in range(2))
    np.testing.assert_allclose(one.scan_from_field.to_matrix(), PLACE.to_matrix())
    assert all(torch.equal(a, b) for a, b in zip(one.modulations, other.modulations, strict=True))


def test_scans_that_say_nothing_are_told_apart():
    model, prior, shape = _chair()
    scan = _scan(shape, 24)
    nothing = scans.Scan(scan.positions, scan.directions, np.full_like(scan.ranges, np.inf))
    with pytest.raises(checks.InputError, match="0 rays that met something of 576"):
        completion.complete(model, prior, nothing, PLACE)
    with pytest.raises(checks.InputError, match="0 rays that met something"):
        completion.guess(nothing, np.array([0.0, 1, 0]))
    millimetres = dataclasses.replace(PLACE, scale=0.0004, translation=PLACE.translation / 1000)
    with pytest.raises(checks.InputError, match="are ranges in millimetres"):
        completion.complete(model, prior, scan, millimetres)
    beside = dataclasses.replace(PLACE, translation=PLACE.translation + 3)
    with pytest.raises(checks.InputError, match="give the pose of the object's box"):
        completion.complete(model, prior, scan, beside)


def test_interval_of_one_sure_shape_is_that_of_its_blur():
    model, prior, shape = _chair()
    own, scatter = _modulations(model, prior), 0.02
    many = [each.expand(8, 1, -1) for each in own]
    found = completion.Completed(PLACE, own, many, np.zeros(0), 1.0, scatter, 1.0, 0.03)
    scan = _scan(shape, 24)
    ends = completed_surface.along_rays(model.field, found, scan.positions, scan.directions, 0.9)
    low, high = ends
    sure = scan.hit.copy()
    inverse = PLACE.inverse()
    along = inverse.apply_directions(scan.directions)
    entry, _, meets = rays.enter_box(inverse.apply(scan.positions), along, -np.ones(3), np.ones(3))
    entering = (torch.from_numpy(each[meets]).float() for each in (entry, along))
    raw = model.field(*entering, own)
    sure[meets] &= (pddf.weights(raw).amax(-1) > 0.999).numpy()
    assert sure.sum() > 5
    half = (high - low)[sure] / 2 / 0.4 / scatter
    outside = 0.75 * np.exp(-half) + 0.25 * np.exp(-half / 5)  # of the blur, in closed form
    np.testing.assert_allclose(outside, 0.1, atol=0.01)
    np.testing.assert_allclose((high + low)[sure] / 2, scan.ranges[sure], atol=0.003)
    assert np.isnan(low[~meets]).all() and np.isfinite(np.stack(ends)[:, meets]).all()


def test_intervals_of_several_shapes_hold_their_share_of_what_is_drawn_from_them():
    model, prior, _ = _chair()
    latents = prior.latents(0.3 * torch.randn(6, 32, generator=torch.Generator().manual_seed(1)))
    samples = [each.detach() for each in model.modulations(latents)]
    found = completion.Completed(PLACE, [each[0] for each in samples], samples, np.zeros(0), 1.0, 0.03, 1.0, 0.03)
    positions, directions = torch.tensor([[0.1, 0.2, 1.0]]), torch.tensor([[0.0, 0.0, -1.0]])
    with torch.no_grad():
        raw = model.field(positions.expand(6, 1, 3), directions.expand(6, 1, 3), samples)
        depths = model.field.depths(raw)[:, 0]
        weights = (pddf.weights(raw)[:, 0] * torch.sigmoid(raw[:, 0, pddf.VISIBILITY_ROW, None])).double().flatten()
    rng, draws = np.random.default_rng(0), 40_000
    chosen = rng.choice(depths.numel(), draws, p=(weights / weights.sum()).numpy())
    drawn = depths.flatten().numpy()[chosen] + rng.laplace(0, 0.03 * np.where(rng.random(draws) < 0.25, 5, 1))
    for share in (0.5, 0.9):
        low, high = completed_surface.intervals(model.field, found, positions, directions, share)
        assert np.mean(drawn < low) == pytest.approx((1 - share) / 2, abs=0.01)
        assert np.mean(drawn > high) == pytest.approx((1 - share) / 2, abs=0.01)


def test_guess_is_the_box_of_the_hits_with_the_vertical_up():
    sphere = np.random.default_rng(0).normal(size=(5000, 3))
    points = sphere / np.linalg.norm(sphere, axis=1, keepdims=True) * 2 + [1, 2, 3]
    for up in np.eye(3):
        place = completion.guess(scans.of_points(points, np.array([9.0, 9, 9])), up)
        np.testing.assert_allclose(place.rotation[:, 1], up)
        assert place.scale == pytest.approx(2, rel=0.05)
        np.testing.assert_allclose(place.translation, [1, 2, 3], atol=0.1)


def test_rotations_are_those_about_their_axes():
    turned = completion.rotations(torch.tensor([[0.0, 0.0, np.pi / 2], [0.3, 0.0, 0.0]]))
    np.testing.assert_allclose(turned[0], [[0.0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-6)
    np.testing.assert_allclose(turned[1, 1:, 1], [math.cos(0.3), math.sin(0.3)], atol=1e-6)


NEAR = transforms.Similarity(1.08, _turned(0.074, 0.246, -0.049), np.array([0.06, -0.04, 0.07]))
FAR = transforms.Similarity(1.0, _turned(0.1, math.radians(60), -0.1), np.array([0.1, 0, -0.1]))


@pytest.mark.parametrize(("known", "start", "away"), [("rabbit-network", NEAR, 0.02), ("armchair", FAR, 0.01)])
def test_a_known_object_is_found_to_a_degree_and_a_hundredth(known, start, away):
    """A network and its size from 15 degrees away; patches from 60."""
    resize = start.scale != 1
    field = ddf.load(known) if "network" in known else ddf.fit(showcase.SHAPES[known]())
    found = ddf.recover_pose(field, ddf.depth_camera(field, size=40), start.to_matrix(), resize=resize)
    assert np.cbrt(np.linalg.det(found[:3, :3])) == pytest.approx(1, abs=0.01 if resize else 1e-6)
    degrees, moved = _apart(transforms.Similarity.of_matrix("pose", found), transforms.Similarity())
    assert degrees < 1 and moved < away


def test_objects_of_one_scan_are_found_at_once_each_where_it_stands(monkeypatch):
    monkeypatch.setattr(completion, "_TOGETHER", 2)
    rabbit = ddf.load("rabbit")
    places = [transforms.Similarity(1.0, _turned(0.2 * k, 0.9 * k, 0.0), np.array([2.5 * k, 0, 0])) for k in range(3)]
    scene = ddf.compose([rabbit] * 3, [place.to_matrix() for place in places])
    off = transforms.Similarity(1.0, _turned(0.1, -0.3, 0.2), np.array([0.05, 0.04, -0.06]))
    starts = np.stack([place.compose(off).to_matrix() for place in places])
    scan = ddf.depth_camera(scene, size=(48, 120), intrinsics=[[55, 0, 60], [0, 55, 24], [0, 0, 1]])
    found = ddf.recover_pose(rabbit, scan, starts)
    assert found.shape == (3, 4, 4)
    for place, matrix in zip(places, found, strict=True):
        degrees, away = _apart(transforms.Similarity.of_matrix("pose", matrix), place)
        assert degrees < 1 and away < 0.03
    with pytest.raises(checks.InputError, match="start must be a 4x4 matrix or several; got none"):
        ddf.recover_pose(rabbit, scan, starts[:0])


def test_of_poses_that_look_the_same_the_least_turned_is_found():
    field = ddf.fit(_shapes.cube(0.6))
    start = np.eye(4)
    start[:3, :3] = _turned(0.0, math.radians(12), 0.0)
    found = ddf.recover_pose(field, ddf.depth_camera(field, size=32), start)
    assert _apart(transforms.Similarity.of_matrix("pose", found), transforms.Similarity())[0] < 2


def test_shapes_that_a_scan_leaves_open_have_the_covariance_of_laplaces_approximation(monkeypatch):
    slopes = torch.tensor([[3.0, 0.0], [1.0, 1.0], [0.0, -0.5]])
    config = dataclasses.replace(QUICK, samples=40_000, prior=0.5)
    alone = latent_prior.LatentPrior(torch.zeros(1), torch.zeros(1, 2))
    linear = completion._Problem(completion._Known(None), alone, 0.1, config)
    monkeypatch.setattr(completion._Problem, "log_likelihoods", lambda _, state, seen: (state.u * slopes).sum(-1))
    best = completion._State(torch.tensor([[0.3, -0.2]]), torch.zeros(1, 3), torch.zeros(1, 3), torch.zeros(1))
    asked = completion._Rays(torch.zeros(3, 3), torch.zeros(3, 3), torch.zeros(3))
    drawn = completion._open(linear, asked, best, torch.Generator().manual_seed(0))
    torch.testing.assert_close(drawn.mean(0), best.u[0], rtol=0, atol=0.02)
    exact = torch.linalg.inv(torch.eye(2) + slopes.T @ slopes / 3 / 0.5)
    torch.testing.assert_close(torch.cov(drawn.T), exact, rtol=0.03, atol=0.01)


def test_half_of_the_first_shapes_are_that_of_the_image():
    model, prior, shape = _chair()
    problem = completion._Problem(model, prior, 0.05, dataclasses.replace(QUICK, draws=8, starts=8))
    seen = completion._evidence(_scan(shape, 24), PLACE, torch.Generator(), prior.mean)
    latent = prior.latents(torch.ones(32))
    state = completion._starts(problem, [seen], None, latent, torch.Generator().manual_seed(0))
    given = prior.coordinates(latent)
    assert int((state.u[0] == given).all(-1).sum()) == 4


def test_noise_widens_in_field_units_and_only_what_the_field_sees_is_explained():
    model, prior, shape = _chair()
    scan, config = _scan(shape, 24), dataclasses.replace(QUICK, steps=3)
    found = completion.complete(model, prior, scan, PLACE, noise=0.01, config=config)
    assert found.width == pytest.approx(math.hypot(config.blur, 0.01 / 0.4))
    problem = completion._Problem(model, prior, config.blur, config)
    given = problem, scan, PLACE, _modulations(model, prior)
    assert completion._residuals(*given)[1] > 0.95
    inverse = PLACE.inverse()
    along = inverse.apply_directions(scan.directions)
    entry, way, meets = rays.enter_box(inverse.apply(scan.positions), along, -np.ones(3), np.ones(3))
    with torch.no_grad():
        raw = model.field(*(torch.from_numpy(each).float() for each in (entry, along)), given[3])
    depth = (way + model.field.depth(raw).double().numpy()) * 0.4  # where the surface would be, did the field see it
    unseen = meets & (raw[:, pddf.VISIBILITY_ROW] < 0).numpy()
    ghosts = dataclasses.replace(scan, ranges=np.where(unseen, depth, np.inf))
    assert completion._residuals(problem, ghosts, *given[2:])[1] == 0
