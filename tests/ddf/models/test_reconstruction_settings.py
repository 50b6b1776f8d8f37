"""Settings of the reconstruction: ranges, shares of steps, learning rates."""

import dataclasses

import pytest
from _hand_made import DDF, PCSIREN, POINTCLOUDS, TRAIN

from ddf.core import checks
from ddf.models import reconstruction_settings

CORRECTION, SHAPE = reconstruction_settings.CorrectionConfig(), reconstruction_settings.ShapeCorrectionConfig()


@pytest.mark.parametrize(
    ("section", "change", "message"),
    [
        (TRAIN, {"batch_size": 1}, "batch_size must be >= 2; got 1"),
        (DDF, {"counts": {"U": 3}}, "counts must give each of E, U, A, B, S, T, O"),
        (DDF, {"mask_pixels": 0}, "mask_pixels must be >= 1"),
        (PCSIREN, {"points": 0}, "points must be >= 1; got 0"),
        (POINTCLOUDS, {"small": 61}, "small must be <= large; got 61 and 60"),
        (CORRECTION, {"free": ()}, "free must list some of azimuth, elevation, radius"),
        (CORRECTION, {"free": ("azimuth", "roll")}, "free"),
        (SHAPE, {"steps": 0}, "steps"),
        (SHAPE, {"mask_size": 0}, "mask_size"),
        (SHAPE, {"learning_rate": 0.0}, "learning_rate"),
        (SHAPE, {"camera_rate": -1.0}, "camera_rate"),
        (SHAPE, {"keep": float("nan")}, "keep"),
        (reconstruction_settings.ProposalConfig(20, 6), {"points": 0}, "points"),
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
    for name in ("learning_rate", "muon"):
        with pytest.raises(checks.InputError, match=f"{name} must be > 0; got 0.0"):
            dataclasses.replace(DDF, **{name: 0.0})


def test_encoders_may_learn_at_a_share_of_the_decoders_rate():
    assert DDF.encoder_share(TRAIN.loop) == 1
    slow = dataclasses.replace(DDF, encoder_learning_rate=5e-4)
    assert slow.encoder_share(TRAIN.loop) == pytest.approx(0.25)  # of the DDF's own 2e-3
    assert dataclasses.replace(slow, learning_rate=None).encoder_share(TRAIN.loop) == pytest.approx(
        5e-4 / TRAIN.loop.learning_rate
    )
    with pytest.raises(checks.InputError, match=r"encoder_learning_rate must be > 0; got 0"):
        dataclasses.replace(DDF, encoder_learning_rate=0.0)
