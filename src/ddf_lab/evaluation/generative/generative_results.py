"""What the generative models of one category reach, from their folders: scores and pictures for the page."""

from typing import Any

from jaxtyping import Float
from torch import Tensor

from ddf.data import shapenet
from ddf.data.batches import category_data
from ddf.models import generated_images, generative_models, generative_settings
from ddf.training import generative_steps, shape_data
from ddf_lab.evaluation.generative import generative_clouds, generative_images, generative_pictures, held_out
from ddf_lab.run import Run


def measure(
    run: Run, section: generative_settings.ScoresConfig
) -> tuple[dict[str, Any], dict[str, Float[Tensor, "_ 3 h w"]]]:
    """The numbers of the page, and the images of its pictures by name."""
    vae, gan = generative_models.load_vae(run.folder("train_vae")), generative_models.load_gan(run.folder("train_gan"))
    rival, data = (
        generative_models.load_gan_2d(run.folder("train_gan2d")),
        (run.index, run.folder("samples"), run.category),
    )
    parts = shape_data.parts(*data, vae.config.held_out)
    pictured, _ = shape_data.read_pictured(*data)
    sampled, _ = shape_data.read_sampled(*data, 1)
    made = {
        generative_images.OURS: generative_images.generated(gan, section.images, section.seed),
        generative_images.FLAT: generative_images.generated_2d(rival, section.images, section.seed),
    }
    network, dataset = generative_steps.load_features(run.folder("train_features")), shapenet.Dataset.open(run.index)
    results = {
        "shapes": {"learned": len(parts.learned), "held_out": len(parts.held_out), "pictured": len(parts.pictured)},
        **of_shapes(vae, parts, run, section),
        "images": generative_images.scores(network, pictured, made, section),
        "consistency": generative_images.consistency(gan, dataset, run.category, list(parts.pictured), section),
    }
    return results, generative_pictures.draw(gan, rival, pictured, sampled, results["prior"]["nearest"], section)


def of_shapes(
    vae: generative_models.ShapeVAE, parts: shape_data.Parts, run: Run, section: generative_settings.ScoresConfig
) -> dict[str, Any]:
    """Held-out shapes encoded and optimised, the divergence, and samples of the prior beside learned shapes."""
    samples = run.folder("samples")
    learned, tested = (shape_data.read(samples, ids)[0] for ids in (parts.learned, parts.held_out))
    truth, known = (
        generative_clouds.of_shapes(category_data.read_shapes(samples, ids), section.cloud_points, section.seed)
        for ids in (parts.held_out, parts.learned)
    )
    latents = {
        "encoded": held_out.encode(vae, tested, section.seed)[0],
        "optimised": held_out.auto_decode(vae, tested, section, run.folder("evaluate_generative") / "latents"),
    }
    found = {}
    for name, own in latents.items():
        fields = generated_images.fields(vae.decoder, own)
        clouds = generative_clouds.of_fields(fields, tested.scales.tolist(), section.cloud_points, section.seed)
        found[name] = generative_clouds.compared(clouds, truth) | {"errors": held_out.errors(vae, own, tested)}
    like = len(tested.ids)  # as many samples as held-out shapes are compared with these
    count = max(section.samples, like)
    prior = generated_images.latents(count, vae.config.latent_features, section.seed, "samples")
    fields = generated_images.fields(vae.decoder, prior)
    drawn = generative_clouds.of_fields(fields, [float(vae.field_scale)] * count, section.cloud_points, section.seed)
    others = [known[row] for row in generative_clouds.spaced(len(known), like)]
    return {
        "held_out": found,
        "divergence": held_out.summary(held_out.divergences(vae, learned, section.seed)),
        "prior": generative_clouds.novelty(drawn[: section.samples], known, parts.learned, like),
        "distribution": {
            "prior": generative_clouds.distribution(drawn[:like], truth),
            "learned": generative_clouds.distribution(others, truth),
        },
    }
