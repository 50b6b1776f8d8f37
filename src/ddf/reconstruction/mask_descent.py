"""Gradient descent on L_M, the loss of the rendered mask: cameras and shapes that agree with the silhouette.

[DDF22] §4.3 moves the predicted camera. Shapes are moved alike (derived here): an encoder guesses the whole shape at
once; the alpha channel then shows where it must be seen and where it must not. The visibility that a DDF renders is
differentiable in the shape's latent too. Camera and scale move with it, for else the shape would have to make up for
their errors, and are given up afterwards: nothing but the image is known here, and the camera is corrected on its own.
A field without visibility, such as PC-SIREN's, has nothing to descend on.
"""

from collections.abc import Callable, Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from ddf.core import checks
from ddf.fields import passes
from ddf.models import reconstruction_models, reconstruction_settings

CAMERA_BETAS = (0.9, 0.999)  # of Adam
SHAPE_BETAS = (0.9, 0.9)  # the mean square of few steps; the usual 0.999 remembers the first, largest gradients
SCALE_RATE = 0.1  # of the logarithm of the scale, as a share of the camera's rate


def scale_from_cloud(points: Float[Tensor, "n 3"]) -> float:
    """v1 units per field unit, from the diagonal of the cloud's box. [DDF22] app. E. InputError where it is a single
    point.
    """
    diagonal = float((points.amax(dim=0) - points.amin(dim=0)).norm())
    if not diagonal > 0:
        raise checks.InputError("the predicted cloud is one point; train the model for longer")
    return 1.0 / diagonal


@torch.no_grad()
def latent_deviation(
    model: reconstruction_models.DDFModel, features: Float[Tensor, "m features"]
) -> Float[Tensor, "z"]:
    """Standard deviations of the latents that the shape encoder gives to images of these pooled features, two or more;
    InputError of fewer.
    """
    if len(features) < 2:
        raise checks.InputError(f"latents vary between images: at least 2 are needed; got {len(features)}")
    return model.shape_encoder.fc(features.to(model.shape_encoder.fc.weight)).std(dim=0)


def correct_camera(
    model: reconstruction_models.DDFModel,
    modulations: Sequence[Float[Tensor, "b 1 _"]],
    camera: Float[Tensor, "b 3"],
    field_scale: Float[Tensor, "b"],
    alpha: Float[Tensor, "b size size"],
    config: reconstruction_settings.CorrectionConfig,
) -> Float[Tensor, "b 3"]:
    """Π̂_∇ = argmin L_M by gradient descent from Π̂; the best camera met on the way. Source: [DDF22] §4.3.

    Elevation and radius stay within the training range, the azimuth may turn past its ends (it is an angle).
    """
    head = model.camera_head
    start = ((camera - head.mean) / head.deviation).detach()
    moved = start.clone().requires_grad_()
    free = torch.tensor([name in config.free for name in reconstruction_settings.CAMERA_NUMBERS], device=camera.device)
    best, best_loss = camera.detach().clone(), torch.full_like(field_scale, torch.inf)

    def loss() -> Float[Tensor, "b"]:
        nonlocal best, best_loss
        current = torch.where(free, moved, start) * head.deviation + head.mean
        bounded = torch.minimum(torch.maximum(current, head.lowest), head.highest)
        current = torch.cat((current[:, :1], bounded[:, 1:]), -1)
        found = reconstruction_models.mask_loss(model.field, modulations, current, field_scale, alpha)
        better = found.detach() < best_loss
        best = torch.where(better[:, None], current.detach(), best)
        best_loss = torch.where(better, found.detach(), best_loss)
        return found

    with passes.rounded(camera.device):
        _descend((moved,), (config.learning_rate,), CAMERA_BETAS, config.steps, loss)
        loss()  # of the last camera
    return best


def correct_shapes(
    model: reconstruction_models.DDFModel,
    latents: Float[Tensor, "b z"],
    deviation: Float[Tensor, "z"],
    camera: Float[Tensor, "b 3"],
    field_scale: Float[Tensor, "b"],
    alpha: Float[Tensor, "b size size"],
    config: reconstruction_settings.ShapeCorrectionConfig,
) -> Float[Tensor, "b z"]:
    """Latents after the descent on L_M + keep · mean (move / deviation)².

    Args:
      latents, camera: what the encoders give. deviation: of the latents of training images (`latent_deviation`).
      field_scale: field units per v1 unit, by the first shape's cloud.
      alpha: of the images, `mask_size` pixels a side.
    """
    head = model.camera_head
    move = torch.zeros_like(latents, requires_grad=True)
    scores = ((camera - head.mean) / head.deviation).detach().clone().requires_grad_()
    growth = torch.zeros_like(field_scale, requires_grad=True)

    def loss() -> Float[Tensor, "b"]:
        modulations = model.modulations(latents + deviation * move)
        seen_from, scale = scores * head.deviation + head.mean, field_scale * growth.exp()
        found = reconstruction_models.mask_loss(model.field, modulations, seen_from, scale, alpha)
        return found + config.keep * move.square().mean(dim=-1)

    rates = (config.learning_rate, config.camera_rate, SCALE_RATE * config.camera_rate)
    with passes.rounded(latents.device):
        _descend((move, scores, growth), rates, SHAPE_BETAS, config.steps, loss)
    return (latents + deviation * move).detach()


def _descend(
    moved: Sequence[Tensor],
    rates: Sequence[float],
    betas: tuple[float, float],
    steps: int,
    loss: Callable[[], Float[Tensor, "b"]],
) -> None:
    """Move some tensors by Adam, each at its rate; the networks get no gradient."""
    groups = [{"params": [value], "lr": rate} for value, rate in zip(moved, rates, strict=True)]
    optimiser = torch.optim.Adam(groups, betas=betas)
    for _ in range(steps):
        for value, gradient in zip(moved, torch.autograd.grad(loss().sum(), moved), strict=True):
            value.grad = gradient
        optimiser.step()
