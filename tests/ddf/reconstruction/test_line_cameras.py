"""Cameras that the image corrects: a field that is sure of what it shows by the true azimuth alone."""

import numpy as np
import pytest
import torch

from ddf.models import line_field
from ddf.reconstruction import line_cameras

DECODER = line_field.LineDecoder(line_field.LineFieldConfig(places=2, width=4), 4)


def _corrected(monkeypatch, off, floor):
    """Degrees that are left of an azimuth that is `off`; floor: the chance of a surface by a wrong camera."""
    true, opaque = 5.9, torch.zeros(48, 48)
    opaque[12:36, 12:36] = 1

    def parts(field, starts, along):
        gap = np.degrees(np.angle(np.exp(1j * (float(field.views.cameras[0, 0, 0]) - true))))
        chance = floor + (0.95 - floor) * np.exp(-((gap / 20) ** 2))
        logits = torch.full((1, len(starts), 1), float(np.log(chance / (1 - chance))))
        return line_field.Parts(torch.ones_like(logits), logits, logits[..., 0], logits[..., 0])

    monkeypatch.setattr(line_field.ImageField, "parts", parts)
    camera = torch.tensor([(true + np.radians(off)) % (2 * np.pi), 0.4, 0.8], dtype=torch.float32)
    features, images, context = torch.zeros(1, 1, 1, 1, 1), torch.zeros(1, 1, 4, 1, 1), torch.zeros(1, 1, 4)
    views = line_field.Views(features, images, context, camera[None, None], images[:, :, 0])
    found = line_cameras.corrected(DECODER, views, opaque)
    assert found[1:].tolist() == camera[1:].tolist() and 0 <= found[0] < 2 * np.pi
    return np.degrees(np.angle(np.exp(1j * (float(found[0]) - true))))


@pytest.mark.parametrize("off", [0.0, 9.0, -22.0, 100.0, 180.0, -130.0])
def test_the_azimuth_turns_to_where_the_field_is_sure(monkeypatch, off):
    assert abs(_corrected(monkeypatch, off, 0.05)) <= 3


@pytest.mark.parametrize("off", [0.0, 180.0])
def test_a_field_that_is_as_sure_elsewhere_moves_nothing_far(monkeypatch, off):
    assert abs(_corrected(monkeypatch, off, 0.92)) == pytest.approx(off, abs=0.1)
