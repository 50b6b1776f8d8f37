"""The updates of a step of either GAN. [DDF22] app. genmodel; Goodfellow et al. 2014; Mescheder et al. 2018.

A step is `CRITIC_STEPS` updates of the critic and one of the generator (`training_loop.fit`). What an update draws
depends on (seed, step, number of the update) alone. Non-saturating loss: the critic lowers softplus(-D(x)) of real and
softplus(D(x)) of fake images, the generator softplus(-D(x)) of its own. R1, of real images: γ E‖∇D(x)‖².
"""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from ddf.core import distributed
from ddf.data.batches import category_data
from ddf.fields import model_files
from ddf.models import generative_settings, image_gans, normal_images

CRITIC_STEPS = 2  # of a step, before the one of the generator; the paper gives none
Update = Callable[[int], tuple[Tensor, dict[str, Tensor]]]


def on_white(images: Float[Tensor, "b 4 h w"]) -> Float[Tensor, "b 3 h w"]:
    """RGBA in [0, 1] over white, as colours in [-1, 1]: what the critic sees."""
    colours, alpha = images[:, :3], images[:, 3:]
    return 2 * (colours * alpha + 1 - alpha) - 1


@dataclasses.dataclass(frozen=True)
class Draw:
    """What one update draws, for the whole batch; of several processes each keeps a part."""

    random: np.random.Generator
    part: slice
    batch: int

    @classmethod
    def of(cls, config: generative_settings.GANConfig, step: int, turn: int) -> "Draw":
        """Of update `turn` of step `step`; the same every time."""
        random = np.random.default_rng((config.loop.seed, step, turn))
        return cls(random, distributed.part(config.batch_size), config.batch_size)

    def real(self, images: category_data.ImageSet) -> Float[Tensor, "b 3 h w"]:
        """Random images of the pool."""
        rows = self.random.integers(0, len(images.shapes), self.batch)[self.part]
        return on_white(images.batch(rows)).to(model_files.device())

    def normal(self, features: int) -> Float[Tensor, "b features"]:
        """N(0, I)."""
        values = self.random.standard_normal((self.batch, features))[self.part].astype(np.float32)
        return torch.from_numpy(values).to(model_files.device())

    def shapes(self, normals: normal_images.NormalSet) -> Float[Tensor, "b 3 h w"]:
        """Normals of random shapes, rendered ahead."""
        rows = self.random.integers(0, len(normals), self.batch)[self.part]
        return normals.batch(rows).to(model_files.device())


def critic_loss(
    critic: nn.Module, real: Float[Tensor, "b 3 h w"], fake: Float[Tensor, "b 3 h w"], penalty: float
) -> tuple[Float[Tensor, ""], dict[str, Tensor]]:
    """The critic's loss with R1 of weight `penalty`, which costs nothing at 0."""
    real = real.requires_grad_(penalty > 0)
    of_real, of_fake = critic(real), critic(fake)
    loss = functional.softplus(-of_real).mean() + functional.softplus(of_fake).mean()
    terms = {"critic": loss.detach(), "real": of_real.detach().mean(), "fake": of_fake.detach().mean()}
    if penalty == 0:
        return loss, terms
    (slopes,) = torch.autograd.grad(of_real.sum(), real, create_graph=True)
    squared = slopes.square().sum(dim=(1, 2, 3)).mean()
    return loss + penalty * squared, {**terms, "penalty": squared.detach()}


def adversarial_loss(critic: nn.Module, fake: Float[Tensor, "b 3 h w"]) -> Float[Tensor, ""]:
    """L_A of the generator; the critic itself gets no gradient."""
    critic.requires_grad_(False)
    loss = functional.softplus(-critic(fake)).mean()
    critic.requires_grad_(True)
    return loss


def image_updates(
    model: image_gans.ImageGAN, images: category_data.ImageSet, normals: normal_images.NormalSet
) -> list[Update]:
    """All updates of a step of the image GAN, in order."""
    gan = model.config

    def critic(turn: int, step: int) -> tuple[Tensor, dict[str, Tensor]]:
        draw = Draw.of(gan, step, turn)
        with torch.no_grad():
            fake = model.colours(draw.shapes(normals), draw.normal(gan.texture_features))
        return critic_loss(model.critic, draw.real(images), fake, gan.gradient_penalty)

    def generator(step: int) -> tuple[Tensor, dict[str, Tensor]]:
        draw = Draw.of(gan, step, CRITIC_STEPS)
        shapes, textures = draw.shapes(normals), draw.normal(gan.texture_features)
        fake = model.colours(shapes, textures)
        adversarial = adversarial_loss(model.critic, fake)
        of_shape = functional.mse_loss(model.normals(fake), shapes)
        of_texture = functional.mse_loss(model.textures(fake), textures)
        total = adversarial + of_shape + of_texture
        terms = {"adversarial": adversarial, "shape": of_shape, "texture": of_texture}
        return total, {name: value.detach() for name, value in terms.items()}

    return [*(functools.partial(critic, turn) for turn in range(CRITIC_STEPS)), generator]


def noise_updates(model: image_gans.NoiseGAN, images: category_data.ImageSet) -> list[Update]:
    """All updates of a step of the 2D GAN, in order."""
    gan = model.config

    def critic(turn: int, step: int) -> tuple[Tensor, dict[str, Tensor]]:
        draw = Draw.of(gan, step, turn)
        with torch.no_grad():
            fake = model.generator(draw.normal(gan.noise_features))
        return critic_loss(model.critic, draw.real(images), fake, gan.gradient_penalty)

    def generator(step: int) -> tuple[Tensor, dict[str, Tensor]]:
        draw = Draw.of(gan, step, CRITIC_STEPS)
        loss = adversarial_loss(model.critic, model.generator(draw.normal(gan.noise_features)))
        return loss, {"adversarial": loss.detach()}

    return [*(functools.partial(critic, turn) for turn in range(CRITIC_STEPS)), generator]


def record(gan: generative_settings.GANConfig, kind: str, category: str) -> dict[str, Any]:
    """What the record of a GAN's file holds besides what every artefact carries."""
    return {"kind": kind, "category": category, "gan": dataclasses.asdict(gan)}
