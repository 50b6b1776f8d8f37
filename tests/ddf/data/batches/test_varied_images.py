"""Varied training images: closed forms of every change, bounds, and that draws depend on the step alone."""

import dataclasses

import numpy as np
import pytest
import torch
from _support import assert_close

from ddf.core import checks
from ddf.data.batches import category_data, varied_images
from ddf.models import reconstruction_settings
from ddf.training import training_steps

OFF: dict[str, float] = {"colour": 0.0, "blur": 0.0, "shift": 0.0, "alpha": 0.0}
ON: dict[str, float] = {"colour": 0.4, "blur": 0.8, "shift": 1.5, "alpha": 0.4}


def _images(count=3, size=24, seed=0):
    """Images whose alpha is 0 near the border and soft elsewhere; RGB is 0 where alpha is."""
    images = torch.rand(count, 4, size, size, generator=torch.Generator().manual_seed(seed)).mul(255).round() / 255
    images[:, 3, :6] = images[:, 3, -6:] = images[:, 3, :, :6] = images[:, 3, :, -6:] = 0
    images[:, :3] *= images[:, 3:] > 0
    return images


def _chances(count=3, **set_to):
    """No change but for the numbers at the given places, `n5=1.0` for the sixth."""
    chances = torch.zeros(count, varied_images.NUMBERS)
    for name, value in set_to.items():
        chances[:, int(name[1:])] = value
    return chances


def _centre(alpha):
    """Mean column and row of an alpha channel."""
    rows, columns = torch.meshgrid(*map(torch.arange, alpha.shape[-2:]), indexing="ij")
    return [float((alpha * places).sum() / alpha.sum()) for places in (columns, rows)]


def test_nothing_switched_on_changes_nothing():
    chances = varied_images.numbers(3, np.random.default_rng(0), slice(None))
    assert_close(varied_images.vary(_images(), chances, OFF), _images(), atol=1e-6)


def test_no_chance_changes_nothing():
    assert_close(varied_images.vary(_images(), _chances(), ON), _images(), atol=1e-6)


def test_brightness_multiplies_and_half_tones_take_a_power_and_alpha_stays():
    images = _images() * torch.tensor([0.5, 0.5, 0.5, 1.0])[:, None, None]
    config = {"colour": 0.3}
    bright = varied_images.vary(images, _chances(n0=1.0, n2=-1.0), config)
    gains = torch.exp(torch.tensor([0.3, 0.2, 0.3]))[:, None, None]
    assert_close(bright[:, :3], images[:, :3] * gains, atol=1e-5)
    assert_close(bright[:, 3], images[:, 3], atol=1e-6)
    powered = varied_images.vary(images, _chances(n4=-1.0), config)
    assert_close(powered[:, :3], images[:, :3] ** float(np.exp(-0.3)), atol=1e-5)


def test_alpha_takes_a_power():
    found = varied_images.vary(_images(), _chances(n5=1.0), {"alpha": 0.5})
    power = _images()[:, 3] ** float(np.exp(0.5))
    assert_close(found[:, 3], torch.where(power < varied_images.LEAST_ALPHA, 0.0, power), atol=1e-6)


@pytest.mark.parametrize(("chance", "pixels"), [(1.0, 2.0), (0.375, 0.75), (-0.5, -1.0), (-0.1, -0.2)])
def test_shift_moves_the_silhouette_by_its_pixels_along_either_axis(chance, pixels):
    config, images = {"shift": 2.0}, _images()
    before = _centre(images[0, 3])
    for place, axis in ((7, 0), (8, 1)):
        found = varied_images.vary(images, _chances(**{f"n{place}": chance}), config)
        after = _centre(found[0, 3])
        assert_close(after[axis] - before[axis], -pixels if _left_is_positive(config) else pixels, atol=0.02)
        assert_close(after[1 - axis], before[1 - axis], atol=0.02)


def _left_is_positive(config):
    dot = torch.zeros(1, 4, 9, 9)
    dot[:, :, 4, 4] = 1
    return bool(varied_images.vary(dot, _chances(1, n7=0.5), config)[0, 3, 4, 3] > 0.5)


def test_whole_shift_keeps_colours_exactly():
    found = varied_images.vary(_images(), _chances(n7=0.5), {"shift": 2.0})
    step = -1 if _left_is_positive({"shift": 2.0}) else 1
    assert_close(found, _images().roll(step, dims=-1), atol=1e-5)


def test_blur_of_a_dot_is_a_gaussian_of_its_width():
    dot = torch.zeros(1, 4, 25, 25)
    dot[:, :, 12, 12] = 1
    alpha = varied_images.vary(dot, _chances(1, n6=-1.0), {"blur": 1.5})[0, 3].double()
    place = torch.arange(-3, 4, dtype=torch.float64)
    assert_close(alpha[12, 9:16] / alpha[12, 12], torch.exp(-(place**2) / (2 * 1.5**2)), atol=1e-4)
    assert_close(alpha[9:16, 12] / alpha[12, 12], torch.exp(-(place**2) / (2 * 1.5**2)), atol=1e-4)
    assert_close(alpha[12, 12], 1 / (2 * torch.pi * 1.5**2), atol=1e-4)
    colour = varied_images.vary(dot, _chances(1, n6=-1.0), {"blur": 1.5})[0, :3]
    assert_close(colour[:, 12, 10:15], torch.ones(3, 5), atol=1e-3)  # colours do not fade with alpha


def test_images_stay_images():
    for seed in range(5):
        chances = varied_images.numbers(3, np.random.default_rng(seed), slice(None))
        found = varied_images.vary(_images(seed=seed), chances, ON)
        assert found.shape == (3, 4, 24, 24) and 0 <= found.min() and found.max() <= 1
        assert (found[:, :3] * (found[:, 3:] == 0) == 0).all()
        assert not torch.equal(found, _images(seed=seed))


def test_processes_draw_the_numbers_of_all():
    whole = varied_images.numbers(6, np.random.default_rng(3), slice(None))
    parts = [varied_images.numbers(6, np.random.default_rng(3), part) for part in (slice(0, 3), slice(3, 6))]
    assert torch.equal(torch.cat(parts), whole)
    assert whole.min() >= -1 and whole.max() < 1 and len(whole.unique()) == whole.numel()


@pytest.mark.parametrize("name", ["colour", "blur", "shift", "alpha"])
def test_changes_out_of_range_are_named(name):
    for value in (-0.1, 9.0, float("nan")):
        with pytest.raises(checks.InputError, match=rf"augmentation\.{name} must be in \[0,"):
            reconstruction_settings.TrainConfig(augmentation={**OFF, name: value})
    with pytest.raises(checks.InputError, match=r"augmentation: unknown name 'color'; .*\(did you mean colour\?\)"):
        reconstruction_settings.TrainConfig(augmentation={"color": 0.1})


def test_batches_differ_by_step_and_repeat_and_leave_rows_as_they_are_without():
    file = category_data.ImageFile(24)
    for image in _images(8):
        file.append(image)
    images = category_data.ImageSet(["a"], [0] * 8, np.zeros(8, dtype=int), file, torch.zeros(8, 3))
    plain = reconstruction_settings.TrainConfig(batch_size=4)
    varied = dataclasses.replace(plain, augmentation=ON)
    first, again, other = (training_steps.Batch.draw(images, varied, step) for step in (0, 0, 1))
    assert torch.equal(first.images, again.images) and not torch.equal(first.images, other.images)
    bare = training_steps.Batch.draw(images, plain, 0)
    assert (bare.rows == first.rows).all() and torch.equal(bare.images, images.batch(bare.rows))
    assert not torch.equal(bare.images, first.images)
