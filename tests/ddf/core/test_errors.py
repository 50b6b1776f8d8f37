"""Unknown names are answered with the known ones and the nearest."""

from ddf.core import errors


def test_the_nearest_is_asked_for_where_one_is_near():
    assert errors.known_names("rabit", ["chair", "rabbit"]) == "chair, rabbit (did you mean rabbit?)"
    assert errors.known_names("xyz", ["chair"]) == "chair" and errors.known_names("a", []) == "none"
