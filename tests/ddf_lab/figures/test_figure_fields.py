"""Recipes of the figures' fits; wrong numbers are named."""

import dataclasses

import pytest

from ddf.core import checks
from ddf_lab.figures import figure_fields

CONFIG = figure_fields.FiguresConfig(10, 10, 10, 10, 10, 32)


def test_the_one_field_is_twice_as_wide_with_twice_the_samples():
    part, whole = figure_fields.recipe("room", CONFIG), figure_fields.recipe("furnished", CONFIG)
    assert [2 * width for width in part.field.hidden] == list(whole.field.hidden)
    assert [2 * count for _, count in part.samples.items()] == [count for _, count in whole.samples.items()]


def test_numbers_below_one_are_named():
    with pytest.raises(checks.InputError, match=r"figures\.steps must be >= 1; got 0"):
        dataclasses.replace(CONFIG, steps=0)
