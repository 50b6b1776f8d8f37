"""The rival of completion has to be right: distances without closed meshes, its training, its surface, its descent."""

from types import SimpleNamespace
from typing import Any

import _shapes
import numpy as np
import pytest
import torch

from bench.reconstruction import complete
from bench.rivals import latent_distances
from ddf.data.synthetic import render
from ddf.fields import siren
from ddf.fit import completion
from ddf.geometry import neighbours, primitives, raycast, rays, scans, transforms
from ddf.geometry.mesh_io import Mesh

SHAPES, UNSEEN = 24, 0.63  # spheres in training, and the radius of one that is completed
CONFIG = latent_distances.Training(siren.SineLayout((48, 48, 48)), 4, steps=300, points=2048, shapes=8, rows=128)


def _spheres():
    points = np.random.default_rng(0).uniform(-1, 1, (SHAPES, CONFIG.points, 3))
    f = np.linalg.norm(points, axis=-1) - np.linspace(0.4, 0.9, SHAPES)[:, None]
    return np.concatenate([points, f[..., None]], axis=-1).astype(np.float32)


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sdf")
    made = latent_distances.trained(_spheres(), CONFIG, folder)
    again = latent_distances.trained(np.zeros_like(_spheres()), CONFIG, folder)  # kept: nothing is learned anew
    assert torch.equal(made.latents, again.latents)
    return made


def test_distances_are_those_of_the_sphere_in_its_cube():
    found = latent_distances.drawn(_shapes.icosphere(5, 0.8), 2000, np.random.default_rng(0))
    np.testing.assert_allclose(found[:, 3], np.linalg.norm(found[:, :3], axis=1) - 0.8, atol=1e-3)
    near = np.abs(found[:, 3])
    assert found.shape == (2000, 4) and (near[:800] < 0.05).all() and (near[1500:] > 0.1).mean() > 0.8


def test_a_sheet_has_no_inside_and_a_room_with_a_slit_has_one():
    sheet = Mesh(np.array([[-1.0, -1, 0], [1, -1, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (200, 3))
    assert latent_distances.outside(raycast.Scene(sheet), points).all()
    ball = _shapes.icosphere(4)
    room = Mesh(ball.vertices, ball.faces[1:])
    points = 3 * np.random.default_rng(0).uniform(-0.5, 0.5, (500, 3))
    inside = np.linalg.norm(points, axis=1) < 0.9
    outside = latent_distances.outside(raycast.Scene(room), points)
    assert outside[inside].mean() < 0.02 and outside[~inside].mean() > 0.9


def test_a_scan_of_one_side_gives_a_sphere_that_was_not_trained_on(model):
    place = transforms.Similarity(2.0, np.eye(3), np.array([1.0, 0, 0]))
    across = np.random.default_rng(1).uniform(-1, 1, (2000, 2))
    starts = np.column_stack([across, np.full(2000, 3.0)])
    along = np.tile([0.0, 0, -1], (2000, 1))
    points = rays.OrientedPoints(*map(torch.from_numpy, (starts, along)))
    depth = primitives.cast(primitives.Sphere(radius=UNSEEN), points).depth
    scan = scans.Scan(place.apply(starts), along, 2 * depth.numpy())
    seen = latent_distances.Evidence.of(scan, place, np.random.default_rng(0))
    assert float((seen.hits.norm(dim=-1) - UNSEEN).abs().max()) < 1e-5
    reach = seen.free.norm(dim=-1) - UNSEEN
    assert bool((reach > -1e-5).all()) and bool((seen.reach > reach - 1e-5).all())
    config = completion.CompletionConfig(draws=4, steps=60, axes=4)
    latent = latent_distances.Completer.of(model, config).complete(seen, 0)
    cloud = latent_distances.cloud(model, latent, 400, np.random.default_rng(0))
    assert np.linalg.norm(cloud, axis=1).mean() == pytest.approx(UNSEEN, abs=0.015)
    gaps = np.linalg.norm(cloud[:, None] - cloud, axis=-1) + 10 * np.eye(400)
    assert gaps.min() > 0.5 * np.median(gaps.min(axis=1))  # evenly


def test_its_row_of_the_bench_is_scored_where_the_shape_stands(model):
    place, mesh = transforms.Similarity(0.5, np.eye(3), np.array([0.1, 0.0, 0.0])), _shapes.icosphere(4, UNSEEN)
    vertices = place.apply(mesh.vertices)
    parts: Any = SimpleNamespace(vertices=vertices, triangles=mesh.faces)
    truth, views = neighbours.Neighbours(complete.K * vertices), [render.View(20.0, 30.0, 1.5)]
    config = completion.CompletionConfig(draws=4, steps=60, axes=4)
    completer = latent_distances.Completer.of(model, config)
    told = complete.by_distances(completer, complete.Case(parts, truth, place, views))
    assert told["chamfer_l2_sq_x1000"] < 0.5 and told["evaluations_x1000"] > 1
