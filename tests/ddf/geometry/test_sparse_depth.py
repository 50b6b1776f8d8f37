"""Images from a lattice: exact where asked, within the tolerance where not, and what may be missed."""

import numpy as np
import pytest
import torch

from ddf.core import checks
from ddf.geometry import cameras, primitives, rays, sparse_depth

HOW = sparse_depth.Refinement(tolerance=1e-3)


def _image(shape, size):
    """Depth of every pixel of a camera three units off, float64, flat."""
    directions = cameras.pixel_directions(size, torch.zeros(0, dtype=torch.float64)).reshape(-1, 3)
    turned = directions * torch.tensor([1.0, 1.0, -1.0]).double() if float(directions[0, 2]) > 0 else directions
    starts = torch.tensor([0.0, 0.0, 3.0]).double().expand_as(turned)
    return primitives.cast(shape, rays.OrientedPoints(starts, turned)).depth.numpy()


def _asking(truth, calls):
    def ask(pixels):
        calls.append(pixels)
        return truth[pixels]

    return ask


@pytest.mark.parametrize("size", [1, 2, 3, 5, 17, 64, 65, 67, 130])
@pytest.mark.parametrize("stride", [1, 2, 4, 8])
def test_what_is_asked_for_is_exact_and_asked_for_once(size, stride):
    truth, calls = _image(primitives.Sphere(radius=0.8), size), []
    image, count = sparse_depth.depth_image(_asking(truth, calls), size, sparse_depth.Refinement(1e-3, stride))
    asked = np.concatenate(calls)
    assert image.shape == (size, size) and count == len(asked) == len(np.unique(asked))
    np.testing.assert_allclose(image.ravel()[asked], truth[asked], rtol=1e-15)
    assert len(calls) <= 1 + np.log2(stride)
    if stride == 1:
        assert count == size**2


@pytest.mark.parametrize("stride", [2, 4, 8])
def test_sphere_from_fewer_rays(stride):
    size = 257
    truth, calls = _image(primitives.Sphere(radius=0.8), size), []
    image, count = sparse_depth.depth_image(_asking(truth, calls), size, sparse_depth.Refinement(1e-3, stride))
    assert count < 0.6 * size**2 / (1 if stride == 2 else 2)
    seen = np.isfinite(truth).reshape(size, size)
    assert 0.05 < seen.mean() < 0.95
    assert (np.isfinite(image) != seen).mean() < 1e-3
    both = seen & np.isfinite(image)
    off = np.abs(image[both] - truth.reshape(size, size)[both])
    assert off.max() < 5e-3 and np.quantile(off, 0.99) < 1e-3


def test_plane_needs_its_lattice_alone():
    """Inverse depth is linear in the pixel on it, but for the length of the rays."""
    size = 129
    directions = cameras.pixel_directions(size, torch.zeros(0, dtype=torch.float64)).reshape(-1, 3).numpy()
    normal = np.array([0.3, -0.2, 1.0])
    truth, calls = 2.0 / np.abs(directions @ normal), []
    image, count = sparse_depth.depth_image(_asking(truth, calls), size, HOW)
    assert count == 33**2 + 32**2
    np.testing.assert_allclose(image.ravel(), truth, atol=1e-3)


def test_no_tolerance_refines_whatever_is_seen():
    size = 65
    truth, calls = _image(primitives.Sphere(radius=0.8), size), []
    image, _ = sparse_depth.depth_image(_asking(truth, calls), size, sparse_depth.Refinement(0.0))
    seen = np.isfinite(truth).reshape(size, size) & np.isfinite(image)
    np.testing.assert_allclose(image[seen], truth.reshape(size, size)[seen], rtol=1e-12)


def test_a_line_narrower_than_the_lattice_is_missed_and_a_wider_one_is_not():
    size = 65
    for width, found in ((1, False), (4, True)):
        truth = np.full((size, size), np.inf)
        truth[:, 21 : 21 + width] = 1.0
        image, _ = sparse_depth.depth_image(_asking(truth.ravel(), []), size, HOW)
        assert np.array_equal(np.isfinite(image), np.isfinite(truth)) is found
        assert np.isfinite(image).any() == found


@pytest.mark.parametrize(("tolerance", "stride"), [(-1.0, 4), (np.nan, 4), (np.inf, 4), (0.1, 3), (0.1, 0)])
def test_wrong_settings_are_refused(tolerance, stride):
    with pytest.raises(checks.InputError, match="must be"):
        sparse_depth.Refinement(tolerance, stride)
