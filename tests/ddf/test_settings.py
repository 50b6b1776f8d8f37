"""Settings: those out of range are refused by name; rates of a training of its own."""

import dataclasses
import math

import pytest
from _hand_made import CLOUD, DDF, POINTCLOUDS, TRAIN
from _tiny_fits import TINY

from ddf.core import checks
from ddf.data import dataset, mesh_config
from ddf.fields import losses, pddf, scene_field, siren
from ddf.fields.grid import octree
from ddf.models import reconstruction_settings

CORRECTION, SHAPE = reconstruction_settings.CorrectionConfig(), reconstruction_settings.ShapeCorrectionConfig()
DATASET = dataset.DatasetConfig("synthetic", {"primitives": 3}, 1, 5, False)
FIELD, LAYOUT = pddf.PDDFConfig((16, 12), 3.0, 1.0, "softplus", 100.0), siren.SineLayout((3,))


@pytest.mark.parametrize(
    ("section", "change", "message"),
    [
        (TRAIN, {"batch_size": 1}, "batch_size must be >= 2; got 1"),
        (TRAIN, {"encoder": "vit"}, r"train\.encoder must be one of resnet; got 'vit'"),
        (DDF, {"counts": {"U": 3}}, "counts must give each of E, U, A, B, S, T, O"),
        (DDF, {"mask_pixels": 0}, "mask_pixels must be >= 1"),
        (DDF, {"learning_rate": 0.0}, "learning_rate must be > 0; got 0.0"),
        (POINTCLOUDS, {"small": 61}, "small must be <= large; got 61 and 60"),
        (CORRECTION, {"free": ()}, "free must list some of azimuth, elevation, radius"),
        (CORRECTION, {"free": ("azimuth", "roll")}, "free"),
        (SHAPE, {"keep": math.nan}, "keep"),
        (TRAIN.loop, {"ema": 1.0}, "^ema must be "),
        (TRAIN.loop, {"clip_norm": -1.0}, "^clip_norm must be "),
        *((FIELD, {"direction_scale": value}, "direction_scale") for value in (0.0, -1.0, math.inf, math.nan)),
        *((LAYOUT, {"hidden": widths}, "hidden must list") for widths in ((), (3, 0))),
        *((LAYOUT, {name: -1.0}, "omega must be positive") for name in ("omega_first", "omega_hidden")),
        (losses.LossWeights(), {"depth": -1.0}, "depth"),
        *((losses.LossWeights(), {"depth_huber": value}, "depth_huber") for value in (0.0, -1.0, math.inf)),
        (CLOUD, {"temperature": 0.0}, "temperature"),
        (CLOUD, {"least_confidence": 1.5}, "least_confidence"),
        (CLOUD, {"recheck": (0.1, 1.5)}, "recheck"),
        *(
            (scene_field.Blend(1.0), {name: value}, f"{name} must be positive and finite; got {value}")
            for name in ("temperature", "inverse_depth")
            for value in (0.0, -1.0, math.inf, math.nan)
        ),
        (octree.PatchConfig(), {"tolerance": 0.0}, "tolerance must be in"),
        *(
            (mesh_config.MeshesConfig(), {name: value}, f"^{name} must be")
            for name, value in (("faces", 3), ("alpha", 0.0), ("alpha", 0.9), ("offset", 0.0), ("measure_points", 0))
        ),
        (TINY, {"minutes": None, "steps": None}, "steps or minutes must be given"),
        (TINY, {"minutes": float("inf")}, "minutes must be finite"),
        (TINY, {"samples": {"E": 1}}, "samples may give each of U, A, B, S, T, O"),
        (TINY, {"minutes": float("nan")}, "minutes must be > 0"),
        (TINY, {"batch": {"U": 1}}, "batch must give each of E, U, A, B, S, T, O"),
        (TINY, {"batch": {**TINY.batch, "O+": 1}}, r"may give U\+, A\+, B\+, S\+, T\+ >= 1"),
        (TINY, {"batch": {**TINY.batch, "S+": 0}}, r"may give U\+, A\+, B\+, S\+, T\+ >= 1"),
        (TINY, {"epsilon_o": 2.0}, "epsilon_o must be < 1"),
        (DATASET, {"categories": {}}, "^categories must name"),
        (DATASET, {"categories": {"boat": 3}}, "boat"),
        (DATASET, {"categories": {"sofa": 3}}, "sofa"),
        (DATASET, {"categories": {"chair": None}}, "must be a number"),
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
