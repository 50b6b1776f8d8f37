"""Cameras that agree with the silhouette: gradient descent on L_M from the predicted camera. [DDF22] §4.3."""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from ddf.fields import passes
from ddf.models import reconstruction_models, reconstruction_settings


def correct_camera(
    model: reconstruction_models.DDFModel,
    modulations: Sequence[Float[Tensor, "b 1 _"]],
    camera: Float[Tensor, "b 3"],
    field_scale: Float[Tensor, "b"],
    alpha: Float[Tensor, "b size size"],
    config: reconstruction_settings.CorrectionConfig,
) -> Float[Tensor, "b 3"]:
    """Π̂_∇ = argmin L_M by gradient descent from Π̂; the best camera met on the way. Source: [DDF22] §4.3.

    Args:
      modulations: of the shapes, see `reconstruction_models.DDFModel.modulations`.
    Returns:
      Cameras; elevation and radius stay within the training range, the azimuth may turn past its ends
      (it is an angle).
    """
    head = model.camera_head
    scores = ((camera - head.mean) / head.deviation).detach().clone().requires_grad_()
    free = scores.new_tensor([name in config.free for name in reconstruction_settings.CAMERA_NUMBERS])
    optimiser = torch.optim.Adam([scores], lr=config.learning_rate)
    best, best_loss = camera.detach().clone(), torch.full_like(field_scale, torch.inf)
    with passes.rounded(camera.device):
        for step in range(config.steps + 1):
            current = scores * head.deviation + head.mean
            bounded = torch.minimum(torch.maximum(current, head.lowest), head.highest)
            current = torch.cat((current[:, :1], bounded[:, 1:]), -1)
            loss = reconstruction_models.mask_loss(model.field, modulations, current, field_scale, alpha)
            better = loss.detach() < best_loss
            best = torch.where(better[:, None], current.detach(), best)
            best_loss = torch.where(better, loss.detach(), best_loss)
            if step < config.steps:
                optimiser.zero_grad()
                (gradient,) = torch.autograd.grad(loss.sum(), scores)
                scores.grad = gradient * free  # Adam leaves alone what never has a gradient
                optimiser.step()
    return best
