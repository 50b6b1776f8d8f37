import dataclasses
import math

import _models
import _shapes
import numpy as np
import pytest
import torch

from ddf.core import checks, shipped_models
from ddf.data import shapenet
from ddf.fields import pddf, shape_field
from ddf.fit import completed_surface, completion, latent_prior
from ddf.geometry import scans, transforms
from ddf.models import out_of_distribution, reconstruction_models

PLACE = transforms.Similarity(0.4, np.eye(3), np.array([1.0, 0.2, -0.3]))
QUICK = completion.CompletionConfig(rays=200, draws=32, starts=2, kept=1, steps=40, samples=8)


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
    prior = latent_prior.of(model, known, 100)
    with torch.no_grad():
        latents = model.shape_encoder.fc(features).double()
    weight = model.shape_encoder.fc.weight.detach().double()
    widened = out_of_distribution.WIDENED * features.double().var(dim=0).mean() * weight @ weight.T
    torch.testing.assert_close(prior.mean.double(), latents.mean(0), rtol=0, atol=1e-5)
    covariance = prior.basis.double() @ prior.basis.double().T
    torch.testing.assert_close(covariance, torch.cov(latents.T) + widened, rtol=0, atol=1e-5)
    u = torch.randn(3, prior.basis.shape[1])
    torch.testing.assert_close(prior.coordinates(prior.latents(u)), u, rtol=0, atol=1e-2)


def test_a_model_that_does_not_know_its_images_is_refused():
    with pytest.raises(checks.InputError, match="does not say what its training images were like"):
        latent_prior.of(_models.ddf_model(), None, 4)


def _chair():
    folder = shipped_models.place("chair")
    model, size, statistics = reconstruction_models.load_ddf(folder)
    model.requires_grad_(False)
    prior = latent_prior.of(model, statistics, 32)
    latent = reconstruction_models.encode_batch(model, shapenet.read_image(folder / "sample_1.png", size)[None])[1][0]
    return (
        model,
        prior,
        shape_field.conditioned(model.field, [each[0] for each in model.modulations(latent[None])], 0.4),
    )


def _scan(shape, size=40):
    """Of the field of a shape whose box is at `PLACE`."""
    from ddf.api.field import Field
    from ddf.api.sensors import depth_camera

    at = dataclasses.replace(shape, field_from_mesh=PLACE.inverse())
    return depth_camera(Field(at), size=size)


def test_a_scan_of_a_field_gives_back_its_pose_and_shape():
    model, prior, shape = _chair()
    scan = _scan(shape)
    turn = math.radians(8)
    off = transforms.Similarity(
        1.05, np.array([[math.cos(turn), 0, math.sin(turn)], [0, 1, 0], [-math.sin(turn), 0, math.cos(turn)]])
    )
    start = dataclasses.replace(PLACE.compose(off), translation=PLACE.translation + 0.02)
    config = dataclasses.replace(QUICK, draws=64, steps=80)
    found = completion.complete(model, prior, scan, start, completion.Doubt(6.0, 0.05, 0.05), config=config)
    between = found.scan_from_field.rotation.T @ PLACE.rotation
    angle = math.degrees(math.acos(min(1.0, (np.trace(between) - 1) / 2)))
    assert angle < 3 and abs(found.scan_from_field.scale / 0.4 - 1) < 0.02
    assert np.linalg.norm(found.scan_from_field.translation - PLACE.translation) < 0.02
    assert found.explained > 0.9 and np.nanmedian(np.abs(found.residuals)) < 0.005
    seen = completed_surface.cloud(model.field, found, scan, 400)
    assert 0.1 < seen.seen.mean() < 0.9 and np.isfinite(seen.spread).mean() > 0.7
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
    model, _, shape = _chair()
    assert shape.modulations is not None
    many = [each.expand(3000, 1, -1) for each in shape.modulations]
    found = completion.Completed(PLACE, list(shape.modulations), many, np.zeros(0), 1.0, 0.0, 0.02)
    scan = _scan(shape, 12)
    low, high = completed_surface.along_rays(model.field, found, scan.positions, scan.directions, 0.9)
    sure = scan.hit.copy()
    inverse = PLACE.inverse()
    entry, along, meets = _entering(inverse, scan)
    raw = model.field(entry, along, list(shape.modulations))
    sure[meets] &= (pddf.weights(raw).amax(-1) > 0.999).numpy()
    assert sure.sum() > 5
    np.testing.assert_allclose((high - low)[sure] / 0.4, 2 * 0.02 * math.log(10), rtol=0.1)
    np.testing.assert_allclose((high + low)[sure] / 2, scan.ranges[sure], atol=0.003)
    assert np.isnan(low[~scan.hit]).all()


def _entering(inverse, scan):
    from ddf.geometry import rays

    along = inverse.apply_directions(scan.directions)
    entry, _, meets = rays.enter_box(inverse.apply(scan.positions), along, -np.ones(3), np.ones(3))
    return torch.from_numpy(entry[meets]).float(), torch.from_numpy(along[meets]).float(), meets


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


@pytest.mark.parametrize("resize", [False, True])
def test_a_known_object_is_found_to_a_degree_and_a_hundredth(resize):
    import ddf

    rabbit = ddf.load("rabbit")
    turn = completion.rotations(math.radians(15) * torch.nn.functional.normalize(torch.tensor([[0.3, 1.0, -0.2]])))
    left, _, right = np.linalg.svd(turn[0].double().numpy())
    start = transforms.Similarity(1.08 if resize else 1.0, left @ right, np.array([0.06, -0.04, 0.07]))
    found = ddf.recover_pose(rabbit, ddf.depth_camera(rabbit, size=40), start.to_matrix(), resize=resize)
    np.testing.assert_allclose(np.cbrt(np.linalg.det(found[:3, :3])), 1, atol=0.01 if resize else 1e-6)
    assert np.trace(found[:3, :3]) > 1 + 2 * math.cos(math.radians(1)) - 0.03 * resize
    assert np.abs(found[:3, 3]).max() < 0.02


def test_a_known_object_of_patches_is_found_from_sixty_degrees_away():
    import ddf
    from ddf.data.synthetic import showcase

    chair = ddf.fit(showcase.SHAPES["armchair"]())
    turned = completion.rotations(torch.tensor([[0.1, math.radians(60), -0.1]]))[0].double().numpy()
    left, _, right = np.linalg.svd(turned)
    start = transforms.Similarity(1.0, left @ right, np.array([0.1, 0.0, -0.1]))
    found = ddf.recover_pose(chair, ddf.depth_camera(chair, size=32), start.to_matrix())
    assert np.trace(found[:3, :3]) > 1 + 2 * math.cos(math.radians(1))
    assert np.abs(found[:3, 3]).max() < 0.01


def _turned(vector):
    left, _, right = np.linalg.svd(completion.rotations(torch.tensor([vector]))[0].double().numpy())
    return left @ right


@pytest.mark.parametrize("together", [2, 64])
def test_objects_of_one_scan_are_found_at_once_each_where_it_stands(together, monkeypatch):
    import ddf

    monkeypatch.setattr(completion, "_TOGETHER", together)
    rabbit = ddf.load("rabbit")
    places = [
        transforms.Similarity(1.0, _turned([0.2 * k, 0.9 * k, 0.0]), np.array([2.5 * k, 0.0, 0.0])) for k in range(3)
    ]
    scene = ddf.compose([rabbit] * 3, [place.to_matrix() for place in places])
    off = transforms.Similarity(1.0, _turned([0.1, -0.3, 0.2]), np.array([0.05, 0.04, -0.06]))
    starts = np.stack([place.compose(off).to_matrix() for place in places])
    scan = ddf.depth_camera(scene, size=(48, 120), intrinsics=[[55, 0, 60], [0, 55, 24], [0, 0, 1]])
    found = ddf.recover_pose(rabbit, scan, starts)
    assert found.shape == (3, 4, 4)
    for place, matrix in zip(places, found, strict=True):
        off = place.inverse().compose(transforms.Similarity.of_matrix("pose", matrix))
        assert np.trace(off.rotation) > 1 + 2 * math.cos(math.radians(1)) and np.abs(off.translation).max() < 0.02
    with pytest.raises(checks.InputError, match="start must be a 4x4 matrix or several; got none"):
        ddf.recover_pose(rabbit, scan, starts[:0])


def test_turns_at_random_are_those_of_their_quaternions_and_no_longer_than_half_a_turn():
    quaternions = torch.randn(4000, 4, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    turns = completion._any_turns(quaternions)
    w, x, y, z = (quaternions / quaternions.norm(dim=1, keepdim=True)).T
    first = torch.stack((1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)), 1)
    torch.testing.assert_close(completion.rotations(turns)[..., 0], first, rtol=0, atol=1e-9)
    assert turns.norm(dim=1).max() <= math.pi
    assert float(turns.norm(dim=1).mean()) == pytest.approx(math.pi / 2 + 2 / math.pi, abs=0.03)  # of all rotations


def test_of_poses_that_look_the_same_the_least_turned_is_found():
    import ddf

    field = ddf.fit(_shapes.cube(0.6))
    start = np.eye(4)
    start[:3, :3] = _turned([0.0, math.radians(12), 0.0])
    found = ddf.recover_pose(field, ddf.depth_camera(field, size=32), start)
    assert np.trace(found[:3, :3]) > 1 + 2 * math.cos(math.radians(2))


def test_starts_that_lie_apart_are_the_best_of_each_turn():
    turns = torch.zeros(2, 5, 3)
    turns[:, :, 1] = torch.deg2rad(torch.tensor([0.0, 10, 40, 50, 90]))
    loss = torch.tensor([[1.0, 0, 2, 3, 9], [5.0, 4, 1, 2, 0]])
    chosen = completion._apart(loss, completion.rotations(turns), 3)
    assert chosen.tolist() == [[1, 2, 4], [4, 2, 1]]
