"""What the generative models of one category reach, from their folders: scores and pictures for the page.

Images of both GANs are set against real ones, with known bounds.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from ddf.core import seeding
from ddf.data.batches import category_data
from ddf.metrics import image_scores
from ddf.models import generated_images, generative_models, generative_settings
from ddf.training import generative_steps, shape_data
from ddf_lab.evaluation import generative_shapes
from ddf_lab.run import Run

CEILING, OURS, FLAT, MEAN, NOISE = "ceiling", "image GAN", "2D GAN", "mean image", "noise"
_CHUNK = 100


def measure(
    run: Run, section: generative_settings.ScoresConfig
) -> tuple[dict[str, Any], dict[str, Float[Tensor, "_ 3 h w"]]]:
    """The numbers of the page, and the images of its pictures by name."""
    vae, gan = generative_models.load_vae(run.folder("train_vae")), generative_models.load_gan(run.folder("train_gan"))
    rival = generative_models.load_gan_2d(run.folder("train_gan2d"))
    data = (run.index, run.folder("samples"), run.category)
    parts = shape_data.parts(*data, vae.config.held_out)
    pictured, _ = shape_data.read_pictured(*data)
    sampled, _ = shape_data.read_sampled(*data, 1)
    made = {
        OURS: generated(gan, section.images, section.seed),
        FLAT: generated_2d(rival, section.images, section.seed),
    }
    network = generative_steps.load_features(run.folder("train_features"))
    results = {
        "shapes": {"learned": len(parts.learned), "held_out": len(parts.held_out), "pictured": len(parts.pictured)},
        **score_shapes(vae, parts, run, section),
        "images": score_images(network, pictured, made, section),
    }
    return results, draw(gan, rival, pictured, sampled, results["nearest"], section)


def score_shapes(
    vae: generative_models.ShapeVAE, parts: shape_data.Parts, run: Run, section: generative_settings.ScoresConfig
) -> dict[str, Any]:
    """Held-out shapes encoded and optimised, the divergence, and samples of the prior beside learned shapes."""
    samples = run.folder("samples")
    learned, tested = (shape_data.read(samples, ids)[0] for ids in (parts.learned, parts.held_out))
    truth, known = (
        generative_shapes.of_shapes(category_data.read_shapes(samples, ids), section.cloud_points, section.seed)
        for ids in (parts.held_out, parts.learned)
    )
    latents = {
        "encoded": generative_shapes.encode(vae, tested, section.seed)[0],
        "optimised": generative_shapes.auto_decode(vae, tested, section, run.folder("evaluate_generative") / "latents"),
    }
    found = {}
    for name, own in latents.items():
        fields = generated_images.fields(vae.decoder, own)
        clouds = generative_shapes.of_fields(fields, tested.scales.tolist(), section.cloud_points, section.seed)
        found[name] = generative_shapes.compared(clouds, truth)
    like = len(tested.ids)  # as many samples as held-out shapes are compared with these
    count = max(section.samples, like)
    prior = generated_images.latents(count, vae.config.latent_features, section.seed, "samples")
    fields = generated_images.fields(vae.decoder, prior)
    drawn = generative_shapes.of_fields(fields, [float(vae.field_scale)] * count, section.cloud_points, section.seed)
    others = [known[row] for row in np.linspace(0, len(known) - 1, min(like, len(known))).round().astype(int)]
    return {
        "held_out": found,
        "divergence": generative_shapes.divergence(vae, learned, section.seed),
        "nearest": [parts.learned[row] for row in generative_shapes.nearest(drawn[: section.samples], known)],
        "distribution": {
            "prior": generative_shapes.distribution(drawn[:like], truth),
            "learned": generative_shapes.distribution(others, truth),
        },
    }


@torch.no_grad()
def generated(model: generative_models.ImageGAN, count: int, seed: int) -> Float[Tensor, "n 3 h w"]:
    """Images of random shapes, textures and cameras, in [-1, 1]."""
    latents = generated_images.latents(count, model.vae.latent_features, seed, "scores: shapes")
    textures = generated_images.latents(count, model.config.texture_features, seed, "scores: textures")
    random = seeding.generator(seed, "scores: cameras")
    found = []
    for field, texture in zip(generated_images.fields(model.decoder, latents), textures, strict=True):
        camera = generated_images.random_camera(model.config.normals, random)
        found.append(2 * generated_images.look(model, field, camera, texture[None]).colours[0] - 1)
    return torch.stack(found).cpu()


@torch.no_grad()
def generated_2d(model: generative_models.NoiseGAN, count: int, seed: int) -> Float[Tensor, "n 3 h w"]:
    """Images of the 2D GAN, in [-1, 1]."""
    noise = generated_images.latents(count, model.config.noise_features, seed, "scores: noise")
    place = next(model.parameters()).device
    return torch.cat([model.generator(part.to(place)).cpu() for part in noise.split(_CHUNK)])


def score_images(
    network: generative_steps.FeatureNetwork,
    images: category_data.ImageSet,
    made: dict[str, Float[Tensor, "_ 3 h w"]],
    section: generative_settings.ScoresConfig,
) -> dict[str, Any]:
    """KID of models, bounds and spoiled images.

    Real images are of every other shape, at random; the ceiling is of the others: no shape is in both.
    """
    random = np.random.default_rng(section.seed)
    halves = (random.permutation(np.flatnonzero(images.shapes % 2 == each))[: section.images] for each in (0, 1))
    real, ceiling = (generative_steps.on_white(images.batch(chosen)) for chosen in halves)
    generator = torch.Generator().manual_seed(section.seed)
    noise = torch.rand(ceiling.shape, generator=generator) * 2 - 1
    sets = {CEILING: ceiling, **made, MEAN: real.mean(dim=0).expand_as(real), NOISE: noise}
    spoiled = image_scores.spoiled(ceiling, section.seed)
    features = {name: network.features(values) for name, values in {**sets, **spoiled}.items()}
    subsets = image_scores.Subsets(section.subsets, section.subset_size, section.seed)
    found = image_scores.table(features, network.features(real), subsets)
    return {**found, "real": len(real), "spoiled": list(spoiled)}


@torch.no_grad()
def draw(
    model: generative_models.ImageGAN,
    rival: generative_models.NoiseGAN,
    images: category_data.ImageSet,
    sampled: category_data.ImageSet,
    nearest: list[str],
    section: generative_settings.ScoresConfig,
) -> dict[str, Float[Tensor, "_ 3 h w"]]:
    """Images by the name of their picture: normals in [-1, 1], colours in [0, 1].

    Args:
      images: what the critic saw. sampled: renders of the VAE's shapes. nearest: id of the learned shape nearest to
        each of the prior's samples.
    """
    latents = generated_images.latents(section.samples, model.vae.latent_features, section.seed, "samples")
    textures = generated_images.latents(section.samples, model.config.texture_features, section.seed, "textures")
    fields, normals = generated_images.fields(model.decoder, latents), model.config.normals
    (camera,) = generated_images.cameras_around(1, sum(normals.elevation_deg) / 2, normals.radius)
    samples = [generated_images.look(model, f, camera, t[None]) for f, t in zip(fields, textures, strict=True)]
    rows = [next(i for i, shape in enumerate(sampled.shapes) if sampled.ids[shape] == name) for name in nearest]
    real = np.arange(0, len(images.shapes), len(images.shapes) // section.samples)[: section.samples]
    found = {
        "samples_normals": torch.stack([seen.normals for seen in samples]),
        "samples_colours": torch.stack([seen.colours[0] for seen in samples]),
        "samples_nearest": _colours(sampled, rows),
        "rival_colours": (generated_2d(rival, section.samples, section.seed) + 1) / 2,
        "real_colours": _colours(images, real),
    }
    return {name: values.cpu() for name, values in found.items()}


def _colours(images: category_data.ImageSet, rows: Sequence[int] | np.ndarray) -> Float[Tensor, "n 3 h w"]:
    """Over white, in [0, 1]."""
    return (generative_steps.on_white(images.batch(np.asarray(rows))) + 1) / 2
