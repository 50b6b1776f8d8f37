"""Shapes that agree with the silhouette of their image: latents moved by gradient descent on L_M (derived here).

An encoder guesses the whole shape at once; the alpha channel then shows where it must be seen and where it must not.
The visibility that a DDF renders is differentiable in the shape's latent, so the latent can descend on L_M as the
camera of [DDF22] §4.3 does. Camera and scale move with it, for else the shape would have to make up for their errors,
and are given up afterwards: nothing but the image is known here, and the camera is corrected on its own
(`camera_correction.correct_camera`). A field without visibility, as PC-SIREN, has nothing to descend on.
"""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from ddf.core import checks
from ddf.fields import passes
from ddf.models import reconstruction_models, reconstruction_settings

BETAS = (0.9, 0.9)  # of Adam: the mean square of few steps; its usual 0.999 remembers the first, largest gradients
SCALE_RATE = 0.1  # of the logarithm of the scale, as a share of the camera's rate


@torch.no_grad()
def deviation(model: reconstruction_models.DDFModel, features: Float[Tensor, "m features"]) -> Float[Tensor, "z"]:
    """Standard deviations of the latents that the shape encoder gives to images of these pooled features.

    Raises:
      InputError: fewer than two images.
    """
    if len(features) < 2:
        raise checks.InputError(f"latents vary between images: at least 2 are needed; got {len(features)}")
    return model.shape_encoder.fc(features.to(model.shape_encoder.fc.weight)).std(dim=0)


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
      latents, camera: as the encoders give them. deviation: of the latents of training images (`deviation`).
      field_scale: field units per v1 unit, as the first shape tells it.
      alpha: of the images, `mask_size` pixels a side.
    """
    head = model.camera_head
    move = torch.zeros_like(latents, requires_grad=True)
    scores = ((camera - head.mean) / head.deviation).detach().clone().requires_grad_()
    growth = torch.zeros_like(field_scale, requires_grad=True)
    rates = (config.learning_rate, config.camera_rate, SCALE_RATE * config.camera_rate)
    moved: Sequence[Tensor] = (move, scores, growth)
    groups = [{"params": [value], "lr": rate} for value, rate in zip(moved, rates, strict=True)]
    optimiser = torch.optim.Adam(groups, betas=BETAS)
    with passes.rounded(latents.device):
        for _ in range(config.steps):
            modulations = model.modulations(latents + deviation * move)
            seen_from, scale = scores * head.deviation + head.mean, field_scale * growth.exp()
            loss = reconstruction_models.mask_loss(model.field, modulations, seen_from, scale, alpha)
            loss = loss + config.keep * move.square().mean(dim=-1)
            for value, gradient in zip(moved, torch.autograd.grad(loss.sum(), moved), strict=True):
                value.grad = gradient
            optimiser.step()
    return (latents + deviation * move).detach()
