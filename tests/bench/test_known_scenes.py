"""Where the bench of poses puts objects."""

import numpy as np

import ddf
from bench.reconstruction import pose


def test_every_object_of_the_wall_is_seen_in_its_own_box_alone(monkeypatch):
    monkeypatch.setattr(pose, "SIDE", 2)
    monkeypatch.setattr(pose, "WALL_PIXELS", 64)
    rabbit = ddf.load("rabbit")
    scan, places = pose.wall(rabbit)
    boxes = [pose.boxed(rabbit).inverse().compose(place.inverse()) for place in places]
    held = np.array([(np.abs(box.apply(scan.points)) <= 1.01).all(axis=1) for box in boxes])
    assert len(places) == 4 and (held.sum(axis=1) > 50).all()
    assert (held.sum(axis=0) == 1).all()
