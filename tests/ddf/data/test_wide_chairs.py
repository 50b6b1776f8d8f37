"""Wide chairs: every family stands on the floor, faces +X, and its closed parts are whole and wound outwards."""

import numpy as np
import pytest

from ddf.data.synthetic import chairs

FAMILIES = [family for family, _ in chairs.FAMILIES[1:]]
CLOSED = {  # what a family adds to the parts of others
    chairs.tub: {"shell", "body"},
    chairs.club: {"cushion", "foot"},
    chairs.lounge: {"sheet"},
    chairs.bent: {"panel", "hoop", "leg"},
    chairs.stool: {"ring"},
    chairs.with_tray: {"tray"},
}


def _all_parts(family):
    return [part for seed in range(12) for part in family(np.random.default_rng(seed))]


@pytest.mark.parametrize("family", CLOSED)
def test_closed_parts_are_whole_and_wound_outwards(family):
    own = [part for part in _all_parts(family) if part.name in CLOSED[family]]
    assert {part.name for part in own} == CLOSED[family]
    for part in own:
        corners = part.vertices[part.triangles]
        assert (corners[:, 0] * np.cross(corners[:, 1], corners[:, 2])).sum() > 0, part.name
        welded = np.unique(part.vertices.round(9), axis=0, return_inverse=True)[1].ravel()[part.triangles]
        edges = np.concatenate([welded[:, [0, 1]], welded[:, [1, 2]], welded[:, [2, 0]]])
        edges = edges[edges[:, 0] != edges[:, 1]]
        assert (np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)[1] == 2).all(), part.name


@pytest.mark.parametrize("family", FAMILIES)
def test_a_chair_stands_on_the_floor_and_its_back_is_behind(family):
    leaning = []
    for seed in range(12):
        points = np.concatenate([part.vertices for part in family(np.random.default_rng(seed))])
        assert abs(points[:, 1].min()) < 0.06 and 0.3 < points[:, 1].max() < 2.0
        assert np.ptp(points[:, 2]) < 1.8 and abs(points[:, 2].max() + points[:, 2].min()) < 0.25
        leaning.append(points[points[:, 1] > 0.9 * points[:, 1].max(), 0].mean() < 0)
    assert family is chairs.stool or np.mean(leaning) >= 0.8


def test_shares_of_the_families_are_of_one():
    assert sum(share for _, share in chairs.FAMILIES) == pytest.approx(1)
