import numpy as np
import pytest

from ddf.core import checks
from ddf.data import splits

CHAIR, CAR = "03001627", "02958343"


def test_natural_order_compares_runs_of_digits_as_numbers():
    names = ["b", "a", "a10", "a9", "a09", "a9b", "10", "9", "9a", "", "a-2", "a10b2", "a10b10"]
    # "a09" and "a9" have equal keys: the plain strings decide.
    expected = ["", "9", "9a", "10", "a", "a09", "a9", "a9b", "a10", "a10b2", "a10b10", "a-2", "b"]
    shuffled = np.random.default_rng(0).permutation(names).tolist()
    assert sorted(shuffled, key=splits.natural_key) == expected


def test_first_four_fifths_of_the_lines_train():
    """7 shapes give 35 lines: 28 train, so the sixth shape in order has 3 views on this side and 2 on the other."""
    ids = ["a10", "a9", "b", "c", "d2", "d10", "e"]
    shapes = splits.split_class(CHAIR, ids)
    assert [shape.id for shape in shapes] == ["a9", "a10", "b", "c", "d2", "d10", "e"]
    assert [len(shape.train_views) for shape in shapes] == [5, 5, 5, 5, 5, 3, 0]
    assert shapes[5].train_views == (0, 1, 2) and shapes[5].test_views == (3, 4)
    strict = splits.split_class(CHAIR, ids, strict=True)
    assert [len(shape.train_views) for shape in strict] == [5, 5, 5, 5, 5, 5, 0]


@pytest.mark.parametrize("count", range(1, 31))
def test_every_view_is_on_exactly_one_side(count):
    for strict in (False, True):
        shapes = splits.split_class(CHAIR, [f"s{i}" for i in range(count)], strict=strict)
        assert all(shape.train_views + shape.test_views == splits.VIEWS for shape in shapes)
        num_train = sum(len(shape.train_views) for shape in shapes)
        assert num_train == 4 * count if not strict else 4 * count <= num_train < 4 * count + 5


def test_lists_follow_the_class_order_and_leave_the_broken_car_out():
    listing = {CAR: ["f9c1d7748c15499c6f2bd1c4e9adb41", "x"], "99999999": ["z"], CHAIR: ["b", "a"]}
    classes = splits.split(listing)
    assert list(classes) == [CHAIR, CAR, "99999999"]
    assert [shape.id for shape in classes[CAR]] == ["x"]
    lines = splits.list_text(classes, "train").splitlines() + splits.list_text(classes, "test").splitlines()
    assert len(lines) == 5 * 4
    assert splits.list_text(classes, "train").startswith(f"Data/ShapeNetP2M/{CHAIR}/a/rendering/00.dat\n")
    assert splits.list_text(classes, "test").startswith(f"Data/ShapeNetP2M/{CHAIR}/b/rendering/03.dat\n")
    assert splits.list_text(classes, "test").endswith("/99999999/z/rendering/04.dat\n")


@pytest.mark.parametrize("name", ["../etc", "a/b", "a\\b", "..", ".", "", "a b", "a\n"])
def test_ids_that_could_leave_their_folder_are_refused(name):
    with pytest.raises(checks.InputError, match="letters, digits"):
        splits.split_class(CHAIR, ["good", name])
    with pytest.raises(checks.InputError, match="letters, digits"):
        splits.split({name: ["good"]})
