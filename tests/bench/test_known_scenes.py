"""Where the benches of poses and of sensors put objects and sensors."""

import numpy as np
import pytest

import ddf
from bench.fields import sensors as bench_sensors
from bench.reconstruction import pose
from ddf.data.synthetic import showcase
from ddf.geometry import sensors, transforms


def test_every_object_of_the_wall_is_seen_in_its_own_box_alone(monkeypatch):
    monkeypatch.setattr(pose, "SIDE", 2)
    monkeypatch.setattr(pose, "WALL_PIXELS", 64)
    rabbit = ddf.load("rabbit")
    scan, places = pose.wall(rabbit)
    boxes = [pose.boxed(rabbit).inverse().compose(place.inverse()) for place in places]
    held = np.array([(np.abs(box.apply(scan.points)) <= 1.01).all(axis=1) for box in boxes])
    assert len(places) == 4 and (held.sum(axis=1) > 50).all()
    assert (held.sum(axis=0) == 1).all()


def test_a_row_says_which_share_is_solved():
    row = pose.row("field", [1.0, 3.0], [(1.9, 1.9), (0.1, 2.1)])
    assert row["error"] == {"solved_percent": 50.0, "angle_deg": 1.0, "scale_percent": 2.0}
    assert row["median_s"] == 2 and row["size"] == {"starts": 2}


@pytest.mark.parametrize("axes", [sensors.CAMERA, sensors.LIDAR])
def test_sensors_of_a_ring_look_at_the_middle_from_one_height_and_from_all_sides(axes):
    mesh = showcase.SHAPES["armchair"]()
    middle, ahead = np.mean(mesh.box(), axis=0), axes.T @ [0.0, 0.0, -1.0]
    poses = [transforms.Similarity.of_matrix("pose", each) for each in bench_sensors.around(mesh, axes, 4)]
    to_middle = np.array([middle - place.translation for place in poses])
    away = np.linalg.norm(to_middle[0])
    for place, way in zip(poses, to_middle, strict=True):
        np.testing.assert_allclose(place.apply_directions(ahead[None])[0], way / away, atol=1e-9)
    np.testing.assert_allclose(to_middle[:, 1], to_middle[0, 1])
    np.testing.assert_allclose(to_middle[:, [0, 2]].sum(axis=0), 0, atol=1e-9)
