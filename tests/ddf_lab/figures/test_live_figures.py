"""Live pages of the figures: what stands in them."""

import json
import re

import _models

from ddf.fields import shape_field
from ddf_lab.figures import figure_fields, fit_figure, room_figure


def _fields(live):
    (text,) = re.findall(r'id="ddf-page">(.*?)</script>', live.content.decode())
    return json.loads(text)


def test_fits_stand_in_a_row(tmp_path):
    field = shape_field.load(_models.write_shape_field(tmp_path / "field"))
    record = _fields(fit_figure.live([("one", field), ("two", field)]))
    assert [each["name"] for each in record["fields"]] == ["one", "two"] and record["box"] is None


def test_the_room_is_cut_open_and_the_rabbit_stands_in_it(tmp_path):
    field = shape_field.load(_models.write_shape_field(tmp_path / "field"))
    record = _fields(room_figure.live((field, field)))
    scale, at = figure_fields.STAND
    placed = record["fields"][1]["world_from_mesh"]
    assert (placed["scale"], placed["translation"]) == (scale, list(at)) and record["box"][1] == [1.05] * 3
