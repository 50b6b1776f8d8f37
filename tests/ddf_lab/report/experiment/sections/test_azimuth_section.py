"""Errors over the azimuth."""

import numpy as np
import pytest

from ddf_lab.evaluation import scoring
from ddf_lab.report.experiment import stage_results
from ddf_lab.report.experiment.sections import azimuth


def test_errors_over_azimuth_belong_to_their_images(reported):
    experiment, run, _ = reported
    results = stage_results.read_results(run)
    ddf = scoring.load_predictions(experiment.artifacts / "pointclouds" / "plane" / "ddf.safetensors")
    (_, chamfer), (_, errors) = azimuth.over_azimuth(results)
    angles, values = chamfer["plane"][0][3]
    assert angles == pytest.approx(np.degrees(ddf.tensors["camera_true"][:, 0]), rel=1e-5)
    rows = results.per_image.set_index(["category", "method", "column"]).loc[("plane", "ddf", "Pi_g-L")]
    assert values == pytest.approx(1000 * rows["chamfer_l2_sq"].to_numpy())
    assert [curve[:3] for curve in chamfer["plane"]] == [("DDF", "ddf", False), ("PC-SIREN", "pc_siren", False)]
    assert [curve[3][1].mean() for curve in errors["plane"]] == pytest.approx(np.degrees([0.1, 0.05, 0.2]), rel=1e-4)
