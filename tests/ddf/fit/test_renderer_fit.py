"""Depth renderers of a shape: exact images of a sphere, a training of a second, errors of exact and of wrong images."""

import dataclasses
import math

import numpy as np
import pytest
import torch
from _support import assert_close

from ddf.core import checks
from ddf.data.synthetic import showcase
from ddf.fields import model_files
from ddf.fields.renderers import depth_renderer
from ddf.fit import renderer_fit
from ddf.geometry import primitives, rays
from ddf.models import loop_config
from ddf.training import training_loop

SIZE = 12
LOOP = loop_config.LoopConfig(2e-3, "cosine", 2, 1.0, 1, 0, 1, 100.0)
TINY = renderer_fit.RendererConfig(
    LOOP, 3, depth_renderer.RendererLayout(8, (4, 4, 4, 4, 4)), images=6, batch=3, regularised=2
)
DDF = dataclasses.replace(TINY, eikonal=0.1, gradient=0.1)


def _images(count=4):
    views = renderer_fit.CameraRange().draw(count, np.random.default_rng(0))
    return renderer_fit.cast(showcase.ball(3.0, 4), views, SIZE)


def test_images_of_a_ball_are_those_of_the_unit_sphere():
    images = _images()
    directions = images.views.directions(SIZE).double()
    positions = images.views.positions.double()[:, None, None].expand_as(directions)
    true = primitives.cast(primitives.Sphere(radius=1.0), rays.OrientedPoints(positions, directions))
    square = -(true.normals * directions).sum(-1) > 0.3  # more squarely than this: beside the outline triangles differ
    assert images.visible[square].all() and 100 < square.sum() < square.numel()
    assert_close(images.depth[square], true.depth[square].float(), atol=5e-3)
    assert (images.normals[square] * true.normals[square]).sum(-1).min() > 0.99
    assert (images.depth[~images.visible] == 0).all()


def test_cameras_stand_in_their_range_and_look_at_the_shape():
    views = renderer_fit.CameraRange(turn_deg=0.0).draw(200, np.random.default_rng(0))
    radius = views.positions.norm(dim=-1)
    assert 2.5 <= radius.min() < 2.6 and 3.1 < radius.max() <= 3.2
    assert_close(views.axes[:, 2], views.positions / radius[:, None], atol=1e-6)
    turned = renderer_fit.CameraRange(turn_deg=5.0).draw(200, np.random.default_rng(0))
    assert_close(turned.axes @ turned.axes.mT, torch.eye(3).expand(200, 3, 3), atol=1e-6)
    cosine = (turned.axes[:, 2] * views.axes[:, 2]).sum(-1)
    assert 4 < math.degrees(cosine.min().arccos()) < 5 * math.sqrt(3)


@pytest.mark.parametrize("config", [TINY, DDF])
def test_a_training_gives_the_same_renderer_again(config, tmp_path):
    mesh = showcase.ball(1.0, 2)
    one, other = (renderer_fit.fit(mesh, config, tmp_path / name) for name in "ab")
    assert all(torch.equal(a, b) for a, b in zip(one.parameters(), other.parameters(), strict=True))
    loaded = depth_renderer.DepthRenderer(config.layout)
    model_files.load_model(loaded, tmp_path / "a")
    assert all(torch.equal(a, b) for a, b in zip(one.parameters(), loaded.parameters(), strict=True))
    rows = training_loop.read_log(tmp_path / "a")
    assert len(rows) == 3 and ("eikonal" in rows[0]) == bool(config.eikonal)
    terms = 5 * rows[0]["depth"] + rows[0]["visibility"]
    terms += sum(getattr(config, name) * rows[0].get(name, 0.0) for name in ("eikonal", "gradient"))
    assert rows[0]["loss"] == pytest.approx(terms, rel=1e-5)


def test_exact_images_have_no_error_and_shifted_ones_theirs():
    true = _images()
    residuals = {"eikonal": torch.full_like(true.depth, 0.25)}
    exact = renderer_fit.errors(true, residuals, true)
    assert exact == pytest.approx({"depth": 0.0, "normals_deg": 0.0, "wrong": 0.0, "eikonal": 0.25}, abs=0.05)
    turn = torch.tensor([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    hidden = true.visible.clone()
    hidden[:2] = False
    shifted = dataclasses.replace(true, depth=true.depth + 0.1, normals=true.normals @ turn, visible=hidden)
    found = renderer_fit.errors(shifted, residuals, true)
    assert found["depth"] == pytest.approx(0.1, abs=1e-5) and found["normals_deg"] > 10
    assert found["wrong"] == pytest.approx(float(true.visible[:2].sum()) / true.visible.numel())


def test_numbers_that_do_not_fit_are_named():
    with pytest.raises(checks.InputError, match="regularised <= batch <= images"):
        dataclasses.replace(TINY, batch=7)
