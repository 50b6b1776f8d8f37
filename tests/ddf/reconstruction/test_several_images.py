"""Several pictures of one object: their cameras, and what is refused."""

from pathlib import Path

import _hand_made
import numpy as np
import pytest
import torch

from ddf.core import checks
from ddf.models import line_field
from ddf.reconstruction import given_cameras, several_images

PICTURE = np.zeros((32, 32, 4), np.uint8)
PICTURE[8:24, 10:22] = 200


@pytest.fixture(scope="module")
def trained():
    return line_field.TrainedImageDDF(_hand_made.line_model(), 32, None)


def test_one_picture_and_the_same_twice_with_its_camera_are_one_object(trained):
    camera = given_cameras.read([(30.0, 25.0, 0.8)], [Path("a.png")])
    once = several_images.reconstruct(trained, [PICTURE], 100, seen_from=camera)
    twice = several_images.reconstruct(trained, [PICTURE, PICTURE], 100, seen_from=camera * 2)
    assert (np.abs(once.cloud - twice.cloud).max(axis=1) < 1e-6).mean() > 0.99  # a tie may be taken either way
    assert once.cameras[0].tolist() == pytest.approx(np.asarray(camera[0]).tolist()) and once.scores == [None]


def test_the_camera_of_each_picture_is_that_of_it_alone(trained):
    pictures = [PICTURE, np.roll(PICTURE, 6, axis=1) // np.array([2, 2, 2, 1], np.uint8)]
    alone = [several_images.reconstruct(trained, [picture], 100).cameras[0] for picture in pictures]
    both = several_images.reconstruct(trained, pictures, 100).cameras
    torch.testing.assert_close(both, torch.stack(alone))
    assert not torch.equal(both[0], both[1])


def test_no_picture_is_told(trained):
    with pytest.raises(checks.InputError, match="a picture are needed"):
        several_images.reconstruct(trained, [], 100)
