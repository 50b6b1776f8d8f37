"""Kept fits: made once, made anew for other settings; wrong numbers are named."""

import dataclasses

import pytest
from _shapes import icosphere
from _tiny_fits import TINY

from ddf.core import checks
from ddf.fit import fitting
from ddf_lab.figures import figure_fields

CONFIG = figure_fields.FiguresConfig(10, 10, 10, 10, 10, 32)


def test_a_fit_is_made_once_and_anew_for_other_settings(tmp_path, monkeypatch):
    made, fit = [], fitting.fit
    monkeypatch.setattr(fitting, "fit", lambda *given, **named: made.append(fit(*given, **named)))
    for settings in (TINY, TINY, dataclasses.replace(TINY, steps=7)):
        figure_fields.keep(icosphere(2), settings, tmp_path)
    assert [result["steps"] for result in made] == [TINY.steps, 7]


def test_the_one_field_is_twice_as_wide_with_twice_the_samples():
    part, whole = figure_fields.recipe("room", CONFIG), figure_fields.recipe("furnished", CONFIG)
    assert [2 * width for width in part.field.hidden] == list(whole.field.hidden)
    assert [2 * count for _, count in part.samples.items()] == [count for _, count in whole.samples.items()]


def test_numbers_below_one_are_named():
    with pytest.raises(checks.InputError, match=r"figures\.steps must be >= 1; got 0"):
        dataclasses.replace(CONFIG, steps=0)
