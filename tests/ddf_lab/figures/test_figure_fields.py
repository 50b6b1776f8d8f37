"""Recipes of the figures' fits; wrong numbers are named."""

import dataclasses

import pytest

from ddf.core import checks
from ddf_lab.figures import figure_fields

CONFIG = figure_fields.FiguresConfig(steps=10, whole_steps=10, picture_size=32)


def test_the_one_field_is_twice_as_wide_with_twice_the_samples():
    part, whole = figure_fields.recipe("room", CONFIG), figure_fields.recipe("furnished", CONFIG)
    assert [2 * width for width in part.field.hidden] == list(whole.field.hidden)
    assert {kind: 2 * count for kind, count in part.samples.items()} == whole.samples


def test_numbers_below_one_are_named():
    with pytest.raises(checks.InputError, match="steps must be >= 1; got 0"):
        dataclasses.replace(CONFIG, steps=0)
