"""Settings: those out of range are refused by name; rates of a training of its own."""

import dataclasses
import math

import pytest
from _hand_made import DDF, POINTCLOUDS, TRAIN
from _tiny_fits import TINY

from ddf.core import checks
from ddf.data import dataset
from ddf.fields import scene_field
from ddf.models import reconstruction_settings

CORRECTION = reconstruction_settings.CorrectionConfig()
DATASET = dataset.DatasetConfig("synthetic", {"primitives": 3}, 1, 5, False)


@pytest.mark.parametrize(
    ("section", "change", "message"),
    [
        (TRAIN, {"encoder": "vit"}, r"train\.encoder must be one of resnet; got 'vit'"),
        (DDF, {"counts": {"U": 3}}, "counts must give each of E, U, A, B, S, T, O"),
        (POINTCLOUDS, {"small": 61}, "small must be <= large; got 61 and 60"),
        (CORRECTION, {"free": ()}, "free must list some of azimuth, elevation, radius"),
        *(
            (scene_field.Blend(1.0), {name: value}, f"{name} must be positive and finite; got {value}")
            for name in ("temperature", "inverse_depth")
            for value in (0.0, -1.0, math.inf, math.nan)
        ),
        (TINY, {"samples": {"E": 1}}, "samples may give each of U, A, B, S, T, O"),
        (TINY, {"batch": {"U": 1}}, "batch must give each of E, U, A, B, S, T, O"),
        (TINY, {"batch": {**TINY.batch, "O+": 1}}, r"may give U\+, A\+, B\+, S\+, T\+ >= 1"),
        (DATASET, {"categories": {}}, "^categories must name"),
        (DATASET, {"categories": {"chair": 1}}, r"categories.chair must be in \[2, 100000\]; got 1"),
        (DATASET, {"source": "public", "categories": {"chair": 3}}, "categories"),
    ],
)
def test_values_out_of_range_are_named(section, change, message):
    with pytest.raises(checks.InputError, match=message):
        dataclasses.replace(section, **change)


def test_own_learning_rates_replace_those_of_the_loop():
    assert DDF.loop(TRAIN.loop) == dataclasses.replace(TRAIN.loop, learning_rate=2e-3)
    assert dataclasses.replace(DDF, learning_rate=None).loop(TRAIN.loop) == TRAIN.loop
    muon = dataclasses.replace(DDF, muon=0.02)
    assert muon.loop(TRAIN.loop) == dataclasses.replace(TRAIN.loop, learning_rate=2e-3, muon=0.02)
    common = dataclasses.replace(TRAIN.loop, muon=0.01)
    assert (DDF.loop(common).muon, muon.loop(common).muon) == (0.01, 0.02)


def test_encoders_may_learn_at_a_share_of_the_decoders_rate():
    assert DDF.encoder_share(TRAIN.loop) == 1
    slow = dataclasses.replace(DDF, encoder_learning_rate=5e-4)
    assert slow.encoder_share(TRAIN.loop) == pytest.approx(0.25)  # of the DDF's own 2e-3
    common = dataclasses.replace(slow, learning_rate=None)
    assert common.encoder_share(TRAIN.loop) == pytest.approx(5e-4 / TRAIN.loop.learning_rate)
