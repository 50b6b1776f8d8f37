"""Updates of generative models: the shape VAE, both GANs, and the image network that scores images.

[DDF22] §4.4, app. genmodel; Goodfellow et al. 2014; Mescheder et al. 2018. A step of a GAN is `CRITIC_STEPS` updates of
the critic and one of the generator (`training_loop.fit`). What an update draws depends on (seed, step, number of the
update) alone. Non-saturating loss: the critic lowers softplus(-D(x)) of real and softplus(D(x)) of fake images, the
generator softplus(-D(x)) of its own. R1, of real images: γ E‖∇D(x)‖².

The image network is chosen here: a ResNet-20 that learns to tell shapes and views apart on images of the shapes that
the VAE has; the critics' images, which the scores are about, show others. Its features are those before the last layer.
Inception's would say more of photographs; these are of renders.
"""

import dataclasses
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int8
from torch import Tensor, nn
from torch.nn import functional

from ddf.data.batches import category_data
from ddf.fields import losses, model_files
from ddf.models import generated_images, generative_models, generative_settings, image_networks
from ddf.training import shape_data

CRITIC_STEPS = 2  # of a step, before the one of the generator. Source: [DDF22] app. genmodel
FEATURES = "image_features"  # kind of the record of the image network's file
_CHUNK = 256  # images at a time; memory only

Update = Callable[[int], tuple[Tensor, dict[str, Tensor]]]


def vae_step(
    model: generative_models.ShapeVAE, shapes: shape_data.Shapes, step: int
) -> tuple[Float[Tensor, ""], dict[str, Tensor]]:
    """The loss on random shapes of step `step`: their clouds are encoded, samples of the same shapes decoded."""
    settings, place = model.config, model.field_scale.device
    random = np.random.default_rng((settings.loop.seed, step))
    drawn = random.choice(len(shapes.ids), settings.batch_size, replace=len(shapes.ids) < settings.batch_size)
    clouds = shapes.clouds(drawn, settings.points, random)
    noise = random.standard_normal((settings.batch_size, settings.latent_features)).astype(np.float32)
    points = shapes.samples.draw(drawn, settings.counts, random).to(place)
    torch.manual_seed(int(random.integers(2**62)))  # of dropout
    mean, log_variance = model.posterior(*(values.to(place) for values in clouds))
    latent = mean + (0.5 * log_variance).exp() * torch.from_numpy(noise).to(place)
    modulations = model.decoder.modulator(latent)
    shape_loss, terms = losses.shape_loss(model.decoder.field, points, modulations, settings.weights)
    divergence = generative_models.divergence(mean, log_variance).mean(dim=0).sum()
    return shape_loss + settings.beta * divergence, {**terms, "divergence": divergence.detach()}


def on_white(images: Float[Tensor, "b 4 h w"]) -> Float[Tensor, "b 3 h w"]:
    """RGBA in [0, 1] over white, as colours in [-1, 1]: what the critic sees."""
    colours, alpha = images[:, :3], images[:, 3:]
    return 2 * (colours * alpha + 1 - alpha) - 1


@dataclasses.dataclass(frozen=True)
class Draw:
    """What one update draws."""

    random: np.random.Generator
    batch: int

    @classmethod
    def of(cls, config: generative_settings.GANConfig, step: int, turn: int) -> "Draw":
        """Of update `turn` of step `step`; the same every time."""
        random = np.random.default_rng((config.loop.seed, step, turn))
        return cls(random, config.batch_size)

    def real(self, images: category_data.ImageSet) -> Float[Tensor, "b 3 h w"]:
        """Random images of the pool."""
        rows = self.random.integers(0, len(images.shapes), self.batch)
        return on_white(images.batch(rows)).to(model_files.device())

    def normal(self, features: int) -> Float[Tensor, "b features"]:
        """N(0, I)."""
        values = self.random.standard_normal((self.batch, features)).astype(np.float32)
        return torch.from_numpy(values).to(model_files.device())

    def shapes(self, normals: Int8[Tensor, "n 3 h w"]) -> Float[Tensor, "b 3 h w"]:
        """Normals in [-1, 1] of random shapes, rendered ahead."""
        rows = self.random.integers(0, len(normals), self.batch)
        return normals[torch.from_numpy(rows)].to(model_files.device()).float() / generated_images.LEVELS


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
    model: generative_models.ImageGAN, images: category_data.ImageSet, normals: Int8[Tensor, "n 3 h w"]
) -> list[Update]:
    """All updates of a step of the image GAN, in order."""
    gan = model.config

    def fake(draw: Draw) -> Float[Tensor, "b 3 h w"]:
        return model.colours(draw.shapes(normals), draw.normal(gan.texture_features))

    def generator(step: int) -> tuple[Tensor, dict[str, Tensor]]:
        draw = Draw.of(gan, step, CRITIC_STEPS)
        shapes, textures = draw.shapes(normals), draw.normal(gan.texture_features)
        made = model.colours(shapes, textures)
        adversarial = adversarial_loss(model.critic, made)
        of_shape = functional.mse_loss(model.normals(made), shapes)
        of_texture = functional.mse_loss(model.textures(made), textures)
        total = adversarial + of_shape + of_texture
        terms = {"adversarial": adversarial, "shape": of_shape, "texture": of_texture}
        return total, {name: value.detach() for name, value in terms.items()}

    return [*_critic_updates(model, images, fake), generator]


def noise_updates(model: generative_models.NoiseGAN, images: category_data.ImageSet) -> list[Update]:
    """All updates of a step of the 2D GAN, in order."""

    def fake(draw: Draw) -> Float[Tensor, "b 3 h w"]:
        return model.generator(draw.normal(model.config.noise_features))

    def generator(step: int) -> tuple[Tensor, dict[str, Tensor]]:
        loss = adversarial_loss(model.critic, fake(Draw.of(model.config, step, CRITIC_STEPS)))
        return loss, {"adversarial": loss.detach()}

    return [*_critic_updates(model, images, fake), generator]


def _critic_updates(
    model: generative_models.ImageGAN | generative_models.NoiseGAN,
    images: category_data.ImageSet,
    fake: Callable[[Draw], Float[Tensor, "b 3 h w"]],
) -> list[Update]:
    def update(turn: int, step: int) -> tuple[Tensor, dict[str, Tensor]]:
        draw = Draw.of(model.config, step, turn)
        with torch.no_grad():
            made = fake(draw)
        return critic_loss(model.critic, draw.real(images), made, model.config.gradient_penalty)

    return [functools.partial(update, turn) for turn in range(CRITIC_STEPS)]


class FeatureNetwork(nn.Module):
    """Scores of the shapes that it learned, and (cos, sin) of the azimuth."""

    def __init__(self, settings: generative_settings.FeaturesConfig, shapes: int) -> None:
        super().__init__()
        self.settings, self.shapes = settings, shapes
        self.body = image_networks.TextureEncoder(shapes + 2, settings.width)

    def parameter_groups(self) -> list[dict[str, Any]]:
        """Of the optimiser."""
        return [{"params": list(self.parameters()), "weight_decay": 1e-4}]

    @torch.no_grad()
    def features(self, images: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "n features"]:
        """Of colours in [-1, 1]; on the CPU."""
        place = next(self.parameters()).device
        return torch.cat([self.body.features(part.to(place)).cpu() for part in images.split(_CHUNK)])


def features_step(
    model: FeatureNetwork, images: category_data.ImageSet, step: int
) -> tuple[Float[Tensor, ""], dict[str, Tensor]]:
    """Cross-entropy of the shape + squared error of (cos, sin) of the azimuth, over random images."""
    random = np.random.default_rng((model.settings.loop.seed, step))
    batch = model.settings.batch_size
    rows = random.integers(0, len(images.shapes), batch)
    place = next(model.parameters()).device
    found = model.body(on_white(images.batch(rows)).to(place))
    shape = functional.cross_entropy(found[:, : model.shapes], torch.from_numpy(images.shapes[rows]).to(place))
    azimuth = images.cameras[rows, 0].to(place)
    view = functional.mse_loss(found[:, model.shapes :], torch.stack((azimuth.cos(), azimuth.sin()), dim=-1))
    return shape + view, {"shape": shape.detach(), "view": view.detach()}


def load_features(folder: Path) -> FeatureNetwork:
    """The network of a folder that stage `train_features` wrote, in evaluation mode."""
    wanted = {"features": generative_settings.FeaturesConfig}
    record, (section,) = generative_models.recorded(folder, FEATURES, "train_features", **wanted)
    model = FeatureNetwork(section, record["shapes"])
    model_files.load_model(model, folder)
    return model
