"""Fields and scenes through the Python interface: ONNX against torch, scenes against fields, distances, refusals."""

import types

import _shapes
import numpy as np
import pytest

import ddf

FRONT = ([[0.0, 0.45, 5.0]], [[0.0, 0.0, -1.0]])


def _rays(count=400, seed=0):
    positions, directions = (each.numpy() for each in vars(_shapes.random_rays(count, seed)).values())
    return positions - 2 * directions, directions


def _turned(angle):
    """By this angle about y, and moved a little."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s, 0.01 * angle], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]])


@pytest.fixture(scope="module")
def rabbit():
    return ddf.load("rabbit-network")


@pytest.fixture(scope="module")
def by_onnx(rabbit, tmp_path_factory):
    return ddf.load(rabbit.export(tmp_path_factory.mktemp("alone") / "alone.onnx"))


def test_onnx_file_and_weights_are_one_field(rabbit, by_onnx):
    outputs = [name for name in by_onnx.outputs if "curvature" not in name]
    assert set(outputs) < set(rabbit.outputs)
    one, other = (field.query(*_rays(), outputs) for field in (by_onnx, rabbit))
    assert 50 < np.isfinite(one["depth"]).sum() < 400
    alike = np.abs(one["weight_1"] - 0.5) > 0.01  # elsewhere the components may change places
    for name in outputs:
        np.testing.assert_allclose(one[name][alike], other[name][alike], atol=2e-3, err_msg=name)
    np.testing.assert_allclose(by_onnx.box, rabbit.box, rtol=1e-6)
    one, other = (field.render(20, 10, size=24)["depth"] for field in (by_onnx, rabbit))
    both = np.isfinite(one) & np.isfinite(other)
    assert both.sum() > 100
    assert np.median(np.abs(one[both] - other[both])) < 1e-5


def test_a_scene_has_a_depth_exactly_where_it_is_visible(rabbit):
    scene = ddf.compose([rabbit] * 3, [_turned(angle) for angle in (0.0, 0.4, 0.8)])
    found = scene.query(*_rays(4000))
    np.testing.assert_array_equal(np.isfinite(found["depth"]), found["visibility"] >= 0.5)


def test_directions_that_are_nearly_of_unit_length_become_so(rabbit):
    starts, along = np.add(FRONT[0], [[0, 0, 1e3]]), np.array(FRONT[1])
    near, exact = (rabbit.query(starts, scale * along)["depth"] for scale in (1 + 9e-5, 1.0))
    np.testing.assert_allclose(near, exact, rtol=1e-7)
    triangle = types.SimpleNamespace(vertices=100 * np.eye(3), faces=[[0, 1, 2]])
    assert ddf.cast(triangle, [[0, 0, 1e3]], [[0, 0, -1.00009]]).depth.tolist() == [900.0]


@pytest.mark.slow
def test_distances_are_those_to_the_surface_and_point_to_it(rabbit):
    lower, upper = rabbit.box
    positions = np.random.default_rng(1).uniform(lower - 0.3, upper + 0.3, (300, 3))
    distances, directions = rabbit.udf(positions)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1.0)
    far = distances > 0.2
    along = rabbit.query(positions[far], directions[far])["depth"]
    assert np.median(np.abs(along - distances[far])[np.isfinite(along)]) < 0.03
    onto, _ = rabbit.udf(positions + distances[:, None] * directions)
    assert np.median(onto) < 2e-3 and onto.max() < 0.03  # hits are small discs: near the surface, not on it


def test_wrong_input_is_one_value_error(rabbit, by_onnx, tmp_path):
    good, along = np.zeros((2, 3)), np.array([[0.0, 0.0, 1.0]] * 2)
    for call, message in (
        (lambda: rabbit.query(good[0], along), r"positions must be numbers of shape .n, 3.; got float64"),
        (lambda: rabbit.query(good, along[:1]), "positions and directions must be as many; got 2 and 1"),
        (lambda: rabbit.query(good, 2 * along), "directions must be unit length"),
        (lambda: rabbit.query(good + np.nan, along), "positions must be finite"),
        (lambda: rabbit.query(good, along, ("colour",)), "outputs must be among .*; got colour"),
        (lambda: ddf.compose([rabbit], []), "a scene needs fields and a transform for each; got 1, 0"),
        (lambda: ddf.compose([rabbit], [np.diag([1.0, 2.0, 1.0, 1.0])]), "this one shears or mirrors"),
        (lambda: ddf.compose([rabbit], [np.diag([-1.0, 1.0, 1.0, 1.0])]), "this one shears or mirrors"),
        (lambda: ddf.compose([rabbit], [np.eye(3)]), "must be a 4x4 matrix"),
        (lambda: ddf.compare(good, good[:1], relative=True), "truth: all points are one"),
        (lambda: ddf.cast(3, good, along), "a mesh must have vertices and faces"),
        (lambda: by_onnx.points(5), "needs the weights of the field"),
        (lambda: rabbit.export(tmp_path / "rabbit.obj"), r"must end in \.onnx or \.html"),
        (lambda: ddf.fit(3, minutes=1.0, steps=1), "a fit takes minutes or steps; got both"),
    ):
        with pytest.raises(ValueError, match=message):
            call()
    with pytest.raises(FileNotFoundError, match=r"hare: no such file .* no field of that name; there are rabbit"):
        ddf.load("hare")


def test_a_saved_field_answers_the_same(tmp_path):
    own = ddf.load(ddf.load("rabbit").save(tmp_path / "own").parent)
    found = ddf.load(own.save(tmp_path / "again").parent)
    seen, other = (field.render(size=32, outputs=("visibility", "depth", "normals")) for field in (own, found))
    assert all(np.array_equal(seen[name], other[name]) for name in seen) and (seen["visibility"] > 0.5).any()
    assert "parameters" in repr(found) and repr(found).startswith(f"Field({tmp_path / 'again'}; ")
