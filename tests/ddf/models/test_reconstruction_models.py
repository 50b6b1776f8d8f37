"""Both reconstruction models: sizes, mask loss, files."""

import dataclasses
import math

import _models
import pytest
import torch
import torchvision

from ddf.core import storage
from ddf.fields import model_files, pddf, rendering
from ddf.models import camera_encoder, encoders, reconstruction_models, reconstruction_settings
from ddf.reconstruction import mask_descent

SMALL_FIELD = pddf.PDDFConfig((24, 24), 2.0, 1.0, "softplus", 20.0)


def _camera(*values):
    return torch.tensor([values])


def test_full_width_encoder_is_torchvisions_resnet18():
    theirs = torchvision.models.resnet18(weights=None, num_classes=5)
    theirs.conv1 = torch.nn.Conv2d(4, 64, 7, 2, 3, bias=False)
    mine = encoders.ResNet18(5, 64)
    mine.load_state_dict(theirs.state_dict())
    images = torch.rand(2, 4, 64, 64, generator=torch.Generator().manual_seed(0))
    assert torch.equal(mine.eval()(images), theirs.eval()(images))


def test_every_parameter_is_in_one_group_with_its_decay():
    model, _ = _models.of_field(SMALL_FIELD, 8, 8)
    groups = model.parameter_groups()
    assert [g["weight_decay"] for g in groups] == [1e-3, 1e-6, 0.0]
    assert [g.get("share", 1.0) for g in groups] == [1.0, 1.0, 1.0]
    slower = model.parameter_groups(encoder_share=0.25)
    assert [g.get("share", 1.0) for g in slower] == [0.25, 0.25, 1.0]
    assert sorted(map(id, model.parameters())) == sorted(id(p) for g in groups for p in g["params"])


def test_camera_head_inverts_its_scores_and_clamps():
    head, truth = camera_encoder.CameraHead(), _models.CAMERAS
    head.fit(truth)
    scores = (truth - truth.mean(0)) / truth.std(0)
    torch.testing.assert_close(head(scores), truth)
    assert float(head.loss(scores, truth)) < 1e-10
    assert float(head.loss(scores + torch.tensor([1.0, 2.0, 0.0]), truth)) == pytest.approx(5.0)
    torch.testing.assert_close(head(torch.full((1, 3), 9.0))[0], truth.amax(0))
    torch.testing.assert_close(head(torch.full((1, 3), -9.0))[0], truth.amin(0))


def test_azimuth_as_sine_and_cosine_is_inverted_and_has_no_end():
    truth = torch.tensor([[0.1, 0.45, 0.7], [3.0, 0.5, 0.8], [6.2, 0.47, 0.9]])
    head = camera_encoder.CameraHead("sincos")
    head.fit(truth)
    pair = torch.stack((truth[:, 0].sin(), truth[:, 0].cos()), dim=-1)
    scores = torch.cat((pair, ((truth - truth.mean(0)) / truth.std(0))[:, 1:]), dim=-1)
    assert scores.shape[-1] == head.num_scores == 4
    assert float(head.loss(scores, truth)) < 1e-10
    assert float(head.loss(scores + torch.tensor([0.0, 2.0, 1.0, 0.0]), truth)) == pytest.approx(5.0)
    turned = truth + torch.tensor([2 * math.pi, 0.0, 0.0])
    assert float(head.loss(scores, turned)) < 1e-10
    longer = scores * torch.tensor([3.0, 3.0, 1.0, 1.0])  # the length of the pair says nothing
    torch.testing.assert_close(head(longer), truth)
    torch.testing.assert_close(head(torch.full((1, 4), 9.0))[0, 1:], truth.amax(0)[1:])


def test_undecided_azimuth_has_no_gradient_and_others_that_of_their_angle():
    head = camera_encoder.CameraHead("sincos")
    head.fit(torch.tensor([[0.1, 0.45, 0.7], [3.0, 0.5, 0.8], [6.2, 0.47, 0.9]]))
    scores = torch.tensor([[0.0, 0.0, 0.0, 0.0], [0.01, -0.01, 0.0, 0.0], [0.6, -0.8, 0.0, 0.0]], requires_grad=True)
    azimuth = head(scores)[:, 0]
    assert azimuth.tolist() == pytest.approx([0.0, 0.0, math.atan2(0.6, -0.8)])
    (gradient,) = torch.autograd.grad(azimuth.sum(), scores)
    assert gradient[:2].tolist() == [[0.0] * 4] * 2
    torch.testing.assert_close(gradient[2], torch.tensor([-0.8, -0.6, 0.0, 0.0]))


@pytest.mark.parametrize("azimuth", ["angle", "sincos"])
def test_correction_turns_back_an_azimuth_past_the_end(azimuth):
    """The ball stands off the centre: its silhouette tells the azimuth. Truth and start lie on either side of 0."""
    model, _ = _models.of_field(SMALL_FIELD, 4, 8, azimuth)
    model.camera_head.fit(torch.tensor([[0.0, 0.43, 0.65], [6.2, 0.53, 0.95], [3.0, 0.5, 0.8]]))
    model.decoder.field = _models.BallField(0.3, centre=torch.tensor([0.5, 0.0, 0.2]))
    truth, start, scale = _camera(0.05, 0.48, 0.8), _camera(2 * math.pi - 0.1, 0.48, 0.8), torch.tensor([2.5])
    image, _ = rendering.render(model.decoder.field, None, truth[0], scale[0], 32, ["visibility"])
    config = reconstruction_settings.CorrectionConfig(40, 0.02, 32, ("azimuth",))
    found = mask_descent.correct_camera(model, [], start, scale, image["visibility"][None], config)
    assert abs(float(found[0, 0]) - 2 * math.pi - 0.05) < 0.01


@pytest.mark.parametrize("radius", [0.5, 0.8, 1.1, 2.0])
def test_mask_loss_is_that_of_the_rendered_visibility_with_rays_that_miss(radius):
    soft = _models.BallField(slope=4)  # its visibility is neither 0 nor 1 in float32
    camera, scale = _camera(0.8, 0.45, radius), torch.tensor([2.5])
    alpha = torch.rand(1, 24, 24, generator=torch.Generator().manual_seed(0))
    image, _ = rendering.render(soft, None, camera[0], scale[0], 24, ["visibility"])
    expected = torch.nn.functional.binary_cross_entropy(image["visibility"], alpha[0])  # over all pixels
    found = reconstruction_models.mask_loss(soft, [], camera, scale, alpha)
    torch.testing.assert_close(found[0], expected, rtol=1e-4, atol=1e-6)


def test_camera_gradient_of_the_mask_loss_equals_finite_differences():
    camera = _camera(0.8, 0.45, 0.8).double().requires_grad_()
    scale, alpha = torch.tensor([2.5], dtype=torch.float64), torch.zeros(1, 16, 16, dtype=torch.float64)
    alpha[:, 3:9, 4:12] = 1

    def loss(camera):
        return reconstruction_models.mask_loss(_models.BallField(), [], camera, scale, alpha).sum()

    (gradient,) = torch.autograd.grad(loss(camera), camera)
    step = torch.tensor([0, 0, 1e-6], dtype=torch.float64)
    slope = (loss(camera.detach() + step) - loss(camera.detach() - step)) / 2e-6
    assert abs(float(slope)) > 1e-3
    torch.testing.assert_close(gradient[0, 2], slope, rtol=1e-4, atol=1e-9)


def test_correction_finds_the_radius_of_a_ball():
    model, _ = _models.of_field(SMALL_FIELD, 4, 8)
    model.camera_head.fit(torch.tensor([[0.0, 0.43, 0.65], [6.2, 0.53, 0.95], [3.0, 0.5, 0.8]]))
    model.decoder.field = _models.BallField()
    truth, start, scale = _camera(1.0, 0.48, 0.72), _camera(1.0, 0.48, 0.9), torch.tensor([2.5])
    image, _ = rendering.render(_models.BallField(), None, truth[0], scale[0], 32, ["visibility"])
    config = reconstruction_settings.CorrectionConfig(60, 0.1, 32, reconstruction_settings.CAMERA_NUMBERS)
    mask = image["visibility"][None]
    found = mask_descent.correct_camera(model, [], start, scale, mask, config)
    assert abs(float(found[0, 2]) - 0.72) < 0.005
    same = mask_descent.correct_camera(model, [], start, scale, mask, dataclasses.replace(config, steps=0))
    torch.testing.assert_close(same, start)
    angles = dataclasses.replace(config, steps=5, free=("azimuth", "elevation"))
    turned = mask_descent.correct_camera(model, [], start, scale, mask, angles)
    assert float(turned[0, 2]) == pytest.approx(float(start[0, 2]))  # a radius that is not free stays
    model.camera_head.fit(torch.tensor([[0.0, 0.43, 0.8], [6.2, 0.53, 0.95], [3.0, 0.5, 0.9]]))
    held = mask_descent.correct_camera(model, [], start, scale, mask, config)
    assert float(held[0, 2]) == pytest.approx(0.8)  # the least radius of the training images


def test_a_model_is_read_whatever_its_record_says_of_its_training(tmp_path):
    model = _models.ddf_model()
    _models.write_model(tmp_path)
    path = tmp_path / model_files.MODEL
    tensors, record = storage.load_tensors(path, framework="torch")
    record["section"] = {"field": record["section"]["field"], "a setting of another version": 1.0}
    storage.save_tensors(path, tensors, record)
    read, size, _ = reconstruction_models.load_ddf(tmp_path)
    assert size == _models.TRAIN.image_size and not read.training
    for name, values in model.state_dict().items():
        assert torch.equal(values, read.state_dict()[name])
