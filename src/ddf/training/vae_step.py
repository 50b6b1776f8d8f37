"""One optimisation step of the shape VAE. [DDF22] §4.4: 𝔏_VAE = 𝔏_S + β L_KL."""

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from ddf.core import distributed
from ddf.fields import losses
from ddf.models import point_encoder, shape_vae
from ddf.training import shape_data


def vae_step(
    model: shape_vae.ShapeVAE, shapes: shape_data.Shapes, step: int
) -> tuple[Float[Tensor, ""], dict[str, Tensor]]:
    """The loss on random shapes of step `step`: their clouds are encoded, samples of the same shapes decoded.

    Of several processes each has a part of the shapes, and dropout of its own.
    """
    settings, place = model.config, model.field_scale.device
    random = np.random.default_rng((settings.loop.seed, step))
    drawn = random.choice(len(shapes.ids), settings.batch_size, replace=len(shapes.ids) < settings.batch_size)
    part = distributed.part(settings.batch_size)
    clouds = shapes.clouds(drawn, settings.points, random, part)
    noise = random.standard_normal((settings.batch_size, settings.latent_features))[part].astype(np.float32)
    points = shapes.draw(drawn, settings.counts, random, part).to(place)
    torch.manual_seed(int(random.integers(2**62)) + distributed.rank())  # of dropout
    mean, log_variance = model.posterior(*(values.to(place) for values in clouds))
    latent = mean + (0.5 * log_variance).exp() * torch.from_numpy(noise).to(place)
    modulations = model.decoder.modulator(latent)
    shape_loss, terms = losses.shape_loss(
        model.decoder.field, points, modulations, settings.weights, settings.loop.matmul
    )
    divergence = point_encoder.divergence(mean, log_variance).mean(dim=0).sum()
    return shape_loss + settings.beta * divergence, {**terms, "divergence": divergence.detach()}
