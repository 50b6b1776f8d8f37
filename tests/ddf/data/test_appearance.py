"""Lights, textures and paints of synthetic shapes: closed forms, bounds, and that they change no silhouette."""

import dataclasses

import numpy as np
import pytest
from _support import assert_close

from ddf.data.synthetic import appearance, assemble, palette, parts, render, write

CATEGORIES = tuple(write.CATEGORIES)
STILL = ((0.0, 0.0, 0.0),) * 3
LAMPS = render.Light(lamps=0.7, key=0.0, sky=0.0, above=0.0, front=0.0)


def _units(count, seed):
    vectors = np.random.default_rng(seed).standard_normal((count, 3)).astype(np.float32)
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _array(values):
    return np.array(values, dtype=np.float32)


@pytest.mark.parametrize("kind", palette.KINDS)
def test_shares_of_every_pattern_fill_zero_to_one(kind):
    random = np.random.default_rng(0)
    texture = palette.Texture(kind, (0.0, 0.0, 0.0), tuple(map(tuple, random.uniform(-9, 9, (3, 3)).tolist())))
    shares = texture.shares(random.uniform(-0.6, 0.6, (20_000, 3)).astype(np.float32))
    assert shares.dtype == np.float32 and shares.shape == (20_000,)
    assert 0 <= shares.min() < 0.05 and 0.95 < shares.max() <= 1


@pytest.mark.parametrize(
    ("kind", "places", "shares"),
    [
        ("stripes", [0.25, 0.75, 1.25, 0.0], [1, 0, 1, 0.5]),
        ("two_tone", [-0.5, -0.011, 0.0, 0.011, 0.5], [0, 0, 0.5, 1, 1]),
        ("band", [-0.7, -0.5, -0.2, 0.0, 0.3, 0.5, 0.7], [0, 0.5, 1, 1, 1, 0.5, 0]),
    ],
)
def test_patterns_of_one_axis_have_their_closed_forms(kind, places, shares):
    """At places along X, of which one period is 1."""
    texture = palette.Texture(kind, (0.0, 0.0, 0.0), ((1.0, 0.0, 0.0), *STILL[1:]))
    assert_close(texture.shares(_array(places)[:, None] * _array([1, 0, 0])), _array(shares))


def test_seams_lie_at_whole_numbers_of_the_first_two_axes():
    texture = palette.Texture("panels", (0.0, 0.0, 0.0), ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    places = _array([[1.0, 0.4, 0.3], [0.4, 2.0, 0.3], [0.4, 0.6, 1.0], [0.4, 0.97, 0.0], [0.4, 0.98, 0.0]])
    assert_close(texture.shares(places), _array([1, 1, 0, 0, 0.5]), atol=1e-4)


def test_two_lamps_of_the_renders_give_their_closed_form_and_cast_no_shadow():
    normals, directions = _units(500, 0), _units(500, 1)
    sharpness, hidden = np.full(500, 9, np.float32), lambda *_: pytest.fail("no shadow ray is needed")
    diffuse, shine, shadow = render.illuminate(LAMPS, 77.0, normals, directions, sharpness, hidden)
    each = [0.7 * (1 + normals @ lamp) / 2 for lamp in np.array([[0, 1, 1], [0, 1, -1]]) / np.sqrt(2)]
    assert_close(diffuse, sum(each), atol=1e-5)
    assert not shadow.any()
    half = np.stack([lamp - directions for lamp in render.LAMPS])
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    assert_close(shine, 0.7 * ((0.5 + 0.5 * (half * normals).sum(-1)) ** 9).sum(0), atol=1e-4)


@pytest.mark.parametrize("category", CATEGORIES)
def test_what_a_shape_wears_changes_neither_mesh_nor_silhouette(category):
    for index in range(3):
        shape = write.make_shape(11, category, index)
        plain = assemble.shape(*_bare(category, index))
        assert (shape.vertices == plain.vertices).all() and (shape.triangles == plain.triangles).all()
        (view,) = write.make_views(11, category, index, 1)
        seen = ((plain, render.STUDIO), (shape, view.light), (shape, LAMPS))
        alphas = [render.Renderer(worn).render(dataclasses.replace(view, light=light))[..., 3] for worn, light in seen]
        assert (alphas[0] == alphas[1]).all() and (alphas[0] == alphas[2]).all() and alphas[0].any()


def _bare(category, index):
    """Parts and generator as `write.make_shape` has them, without anything worn."""
    random = write.generator(11, category, index, "mesh")
    return write.CATEGORIES[category](random), random


def test_texture_is_drawn_where_the_paint_is_and_nowhere_else():
    """A white box beside a white box with a black lower half, under light that is the same everywhere."""
    flat = render.Light(lamps=0.0, key=0.0, sky=1.0, above=0.0, front=0.0, gamma=1.0)
    white = parts.Paint((0.8, 0.8, 0.8))
    half = dataclasses.replace(white, texture=appearance._two_tone(0.0, (0.0, 0.0, 0.0)))
    boxes = [parts.box((x, 0.0, 0.0), (1.0, 1.0, 0.1), paint) for x, paint in ((-0.8, white), (0.8, half))]
    shape = assemble.shape(boxes, np.random.default_rng(0))
    image = render.Renderer(shape).render(render.View(90.0, 0.0, 1.2, flat))
    found = image[image[..., 3] == 255][:, 0]
    assert set(np.unique(found)) <= set(range(205)) and (found == 204).sum() > 2.5 * (found == 0).sum() > 100
    dark = np.argwhere((image[..., 0] == 0) & (image[..., 3] == 255))
    assert dark[:, 0].min() >= 67  # below the middle
    assert len(set((dark[:, 1] > 68).tolist())) == 1  # one box alone


def test_cameras_are_those_that_the_seed_always_gave():
    views = write.make_views(7, "car", 0, 2)
    found = [(view.azimuth_deg, view.elevation_deg, view.ratio) for view in views]
    assert found == [(304.20525, 29.603893, 0.734395), (220.576644, 29.865435, 0.778746)]
