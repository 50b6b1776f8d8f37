"""Real and procedural test shapes are kept apart where a data set has both."""

from ddf.data.public import manifest
from ddf_lab.evaluation import groups

REAL = next(row.id for row in manifest.of(["chair"]) if row.split == "test")


def _index(source):
    def shape(name, tests=True):
        return {"id": name, "train_views": [] if tests else [0], "test_views": [0] if tests else []}

    shapes = [shape("a"), shape("b", tests=False), shape(REAL)]
    return {"source": source, "categories": {"chair": {"shapes": shapes}, "car": {"shapes": [shape("c")]}}}


def test_real_shapes_come_first_and_no_group_is_empty():
    index = _index("both")
    assert list(groups.names(index)) == ["real chair", "procedural chair", "procedural car"]
    assert list(groups.names(index).values()) == ["chair", "chair", "car"]
    assert groups.of_shapes(index, "chair") == {"a": "procedural chair", REAL: "real chair"}


def test_one_source_is_one_group_a_category():
    index = _index("public")
    assert groups.names(index) == {"chair": "chair", "car": "car"}
    assert groups.of_shapes(index, "chair") == {"a": "chair", REAL: "chair"}
