"""Cameras that the image corrects: a field that is sure of what it shows by the true azimuth alone."""

import numpy as np
import pytest
import torch

from ddf.models import line_field
from ddf.reconstruction import line_cameras

DECODER = line_field.LineDecoder(line_field.LineFieldConfig(places=2, width=4), 4)


def _views(camera):
    features, images, context = torch.zeros(1, 1, 1, 1, 1), torch.zeros(1, 1, 4, 1, 1), torch.zeros(1, 1, 4)
    return line_field.Views(features, images, context, camera[None, None], images[:, :, 0])


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
    found = line_cameras.corrected(DECODER, _views(camera), opaque)
    assert found[1:].tolist() == camera[1:].tolist() and 0 <= found[0] < 2 * np.pi
    return np.degrees(np.angle(np.exp(1j * (float(found[0]) - true))))


@pytest.mark.parametrize("off", [0.0, 9.0, -22.0, 100.0, 180.0, -130.0])
def test_the_azimuth_turns_to_where_the_field_is_sure(monkeypatch, off):
    assert abs(_corrected(monkeypatch, off, 0.05)) <= 3


@pytest.mark.parametrize("off", [0.0, 180.0])
def test_a_field_that_is_as_sure_elsewhere_moves_nothing_far(monkeypatch, off):
    assert abs(_corrected(monkeypatch, off, 0.92)) == pytest.approx(off, abs=0.1)


def test_what_lines_meet_counts_by_its_chance_and_what_was_not_asked_not_at_all(monkeypatch):
    logits = torch.logit(torch.tensor([[[0.8, 0.5], [0.4, 0.5]]]))
    logits[..., 1] = torch.tensor([line_field.EMPTY, line_field.EMPTY - 1])
    parts = line_field.Parts(logits, logits, logits[..., 0], logits[..., 0])
    monkeypatch.setattr(line_field.ImageField, "parts", lambda *_: parts)
    field = line_field.ImageField.of(DECODER, _views(torch.tensor([0.0, 0.4, 0.8])))
    told = line_cameras._sure(field, torch.zeros(2, 3), torch.zeros(2, 3))
    assert told == pytest.approx(np.log((0.8**2 + 0.4**2) / 2), abs=1e-5)
