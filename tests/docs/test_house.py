"""The picture of the house shows every room at its level, as the test of imports has them."""

import importlib.util
from pathlib import Path

from test_import_graph import LEVELS

PAGE = Path(__file__).resolve().parents[2] / "docs" / "house.py"


def test_the_picture_has_every_room_at_its_level():
    spec = importlib.util.spec_from_file_location("house", PAGE)
    assert spec is not None and spec.loader is not None
    house = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(house)
    assert set(house.ROOMS) == set(LEVELS)
    assert house.OUT.read_text(encoding="utf-8") == house.picture(), "run: python docs/house.py"
