"""Latents on their way to the silhouette of an image: of a ball whose place the latent says, so the truth is known."""

import dataclasses

import _models
import pytest
import torch

from ddf.core import checks
from ddf.fields import rendering, siren
from ddf.models import reconstruction_settings
from ddf.reconstruction import mask_descent

HOW = reconstruction_settings.ShapeCorrectionConfig(
    steps=60, learning_rate=0.1, camera_rate=0.0, keep=0.0, mask_size=24
)
CAMERA, SCALE = torch.tensor([[0.4, 0.48, 0.8]]), torch.tensor([2.5])
DEVIATION = torch.tensor([0.2, 0.2, 0.2, 0.0, 1.0])  # the fourth number never varies, the fifth says nothing


class _Told(siren.Modulator):
    """Modulations that are the latent itself."""

    def __init__(self):
        super().__init__(5, (5,))

    def forward(self, latent):
        return [latent[:, None, :]]


def _model():
    model, _ = _models.of_field(_models.FIELD, 5, 4)
    model.camera_head.fit(_models.CAMERAS)
    model.decoder.field, model.decoder.modulator = _models.BallField(0.35, 15), _Told()
    return model


def _alpha(model, latent, camera=CAMERA):
    image, _ = rendering.render(model.field, [latent], camera[0], SCALE[0], HOW.mask_size, ["visibility"])
    return image["visibility"][None]


def test_a_shape_moves_to_where_the_image_shows_it():
    model = _model()
    truth, start = torch.tensor([[0.25, 0.1, -0.2, 0.7, 0.3]]), torch.tensor([[0.05, -0.1, 0.0, 0.7, 0.3]])
    found = mask_descent.correct_shapes(model, start, DEVIATION, CAMERA, SCALE, _alpha(model, truth), HOW)
    before, after = ((_alpha(model, one) - _alpha(model, truth)).abs().mean() for one in (start, found))
    assert float(after) < 0.1 * float(before)
    assert float(found[0, 3]) == pytest.approx(0.7)  # what never varies, stays
    assert not found.requires_grad


def test_camera_and_scale_take_their_share_and_are_given_up():
    """The image is smaller than the ball from this camera: with the camera fixed the ball can only move away."""
    model, latent = _model(), torch.tensor([[0.0, 0.0, 0.0, 0.0, 0.0]])
    alpha = _alpha(model, latent, CAMERA + torch.tensor([[0.0, 0.0, 0.1]]))
    given = (model, latent, DEVIATION, CAMERA, SCALE, alpha)
    both = (dataclasses.replace(HOW, camera_rate=rate, keep=1e-3) for rate in (0.0, 0.3))
    held, freed = (float(mask_descent.correct_shapes(*given, how).norm()) for how in both)
    assert freed < 0.6 * held
    assert torch.equal(CAMERA, torch.tensor([[0.4, 0.48, 0.8]])) and torch.equal(SCALE, torch.tensor([2.5]))


def test_a_heavy_weight_keeps_the_shape_as_encoded():
    model, start = _model(), torch.tensor([[0.05, -0.1, 0.0, 0.7, 0.3]])
    alpha = _alpha(model, torch.tensor([[0.25, 0.1, -0.2, 0.7, 0.3]]))
    moved = {}
    for keep in (0.0, 1.0, 100.0):
        how = dataclasses.replace(HOW, keep=keep)
        found = mask_descent.correct_shapes(model, start, DEVIATION, CAMERA, SCALE, alpha, how)
        moved[keep] = float((found - start).norm())
    assert moved[0.0] > 2 * moved[1.0] > 4 * moved[100.0]


def test_images_of_a_batch_do_not_know_each_other():
    model = _models.ddf_model()
    generator = torch.Generator().manual_seed(0)
    alpha = (torch.rand(2, 16, 16, generator=generator) > 0.5).float()
    latents, deviation = torch.randn(2, 6, generator=generator), torch.rand(6, generator=generator)
    how = reconstruction_settings.ShapeCorrectionConfig(5, 0.05, 0.05, 0.01, 16)
    cameras, scales = _models.CAMERAS[:2], torch.tensor([2.0, 2.5])
    both = mask_descent.correct_shapes(model, latents, deviation, cameras, scales, alpha, how)
    assert float((both - latents).abs().max()) > 1e-3
    for row in range(2):
        one = slice(row, row + 1)
        alone = mask_descent.correct_shapes(model, latents[one], deviation, cameras[one], scales[one], alpha[one], how)
        torch.testing.assert_close(alone, both[one], atol=2e-3, rtol=0)
    assert all(parameter.grad is None for parameter in model.parameters())


def test_deviation_is_that_of_the_encoders_latents():
    model = _models.ddf_model()
    images = torch.rand(7, 4, 32, 32, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        features, latents = model.shape_encoder.stages(images)[-1], model.shape_encoder(images)
    torch.testing.assert_close(mask_descent.latent_deviation(model, features), latents.std(0))
    with pytest.raises(checks.InputError, match="at least 2 are needed; got 1"):
        mask_descent.latent_deviation(model, features[:1])
