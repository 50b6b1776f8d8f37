"""Where the fields of a page stand."""

import dataclasses

import _models
import numpy as np
import pytest
from _support import assert_close

from ddf.fields import shape_field
from ddf.geometry import transforms
from ddf.io import viewable


@pytest.fixture
def shapes(tmp_path):
    """A field, and one ten times as large that stands elsewhere."""
    one = shape_field.load(_models.write_shape_field(tmp_path / "one"))
    other = transforms.Similarity(0.002, np.eye(3), np.array([7.0, -2.0, 1.0]))
    return one, dataclasses.replace(one, field_from_mesh=other)


def _boxes(page, shapes):
    places = [transforms.Similarity.from_dict(field.record["world_from_mesh"]) for field in page.fields]
    return [place.apply(viewable.corners(shape)) for place, shape in zip(places, shapes, strict=True)]


@pytest.mark.parametrize(("up", "height", "right"), [("y", 1, [0, 0, -1]), ("z", 2, [0, 1, 0])])
def test_a_row_stands_on_one_floor_as_large_as_the_first(shapes, up, height, right):
    page = viewable.side_by_side("row", [("small", shapes[0]), ("large", shapes[1])], up)
    first, second = _boxes(page, shapes)
    side = np.ptp(viewable.corners(shapes[0]), axis=0)
    assert_close(np.ptp(first, axis=0), side)
    assert_close(np.ptp(second, axis=0), side)
    assert_close((second @ right).min() - (first @ right).max(), np.array(viewable.GAP * side.max()))
    for box in (first, second):
        assert_close(box[:, height].min(), np.array(0.0), atol=1e-12)
        assert_close(box[:, 0].min(), -box[:, 0].max())
    both = np.concatenate([first, second])
    assert_close(page.corners.min(axis=0), both.min(axis=0))
    assert_close(page.corners.max(axis=0), both.max(axis=0))
