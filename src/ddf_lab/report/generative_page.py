"""The page of a generative experiment: pictures first, then what was measured. [DDF22] §4.4.

Everything comes from what the trainings and the stage `evaluate_generative` wrote.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch

from ddf.core import storage
from ddf.metrics import cloud_scores
from ddf.models import generated_images, generative_settings
from ddf.pictures import picture_strips
from ddf.training import training_loop
from ddf_lab.evaluation import generative_scores
from ddf_lab.report import pages
from ddf_lab.run import Run

PAPER_FID = {generative_scores.OURS: "27", generative_scores.FLAT: "15"}  # [DDF22] §4.4
RATIO = 1.3  # of D_C through the encoder to that of optimised latents
MOST_TOLD_APART = 0.75  # of samples that are hard to tell from learned shapes
TRAININGS = {
    "train_vae": "shape VAE",
    "train_gan": "image GAN",
    "train_gan2d": "2D GAN",
    "train_features": "feature network",
}
_IMAGES = {
    generative_scores.CEILING: "real images of other shapes (ceiling)",
    generative_scores.OURS: "image GAN: latent, field, normals, colours",
    generative_scores.FLAT: "2D GAN: noise, colours",
    generative_scores.MEAN: "mean of the real images",
    generative_scores.NOISE: "noise",
}
_LATENTS = {"encoded": "encoded from points", "optimised": "latents optimised on the shape"}


def write(run: Run, gan: generative_settings.GANConfig, section: generative_settings.ScoresConfig) -> None:
    """Read the results of the experiment and write the page."""
    evaluated = run.folder("evaluate_generative")
    scores = storage.read_json(evaluated / "scores.json")
    pictures, _ = storage.load_tensors(evaluated / "pictures.safetensors")
    told, shapes = scores["distribution"]["prior"]["told_apart"], scores["shapes"]
    lead = (
        f"This model {'works' if told <= MOST_TOLD_APART else 'fails'}: its samples are told apart from held-out "
        f"shapes {100 * told:.0f} % of the time; 50 is best.",
        f"Experiment `{run.name}`: a shape VAE of {shapes['learned']} {run.category} shapes, and images from its "
        "normals.",
        f"Made by `make reproduce-generative CONFIG=configs/{run.name}.yaml`. All numbers were measured here, unless a "
        "column says paper.",
        f"The critics saw images of {shapes['pictured']} other shapes. {shapes['held_out']} shapes were held out.",
        f"`ddf generate artifacts/{run.name}/train_gan/{run.category} OUT_DIR` draws more.",
    )
    sections = [
        _samples(pictures),
        _shapes(scores),
        _prior(scores["distribution"]),
        _images(scores, gan, section),
        _trainings(run),
    ]
    pages.write(pages.Page(f"Generated {run.category} shapes", [lead], sections), run.page)


def _samples(pictures: Mapping[str, np.ndarray]) -> pages.Section:
    rows = {
        "normals of samples of the prior": "samples_normals",
        "their images, each with a random texture": "samples_colours",
        "a render of the nearest learned shape": "samples_nearest",
        "2D GAN": "rival_colours",
        "real images": "real_colours",
    }
    images = {title: pictures[key] for title, key in rows.items()}
    normals, *others = images.items()
    on_white = generated_images.on_white(torch.from_numpy(normals[1])).numpy()
    sheet = picture_strips.sheet([(normals[0], on_white), *others])
    caption = "Not chosen: the first samples of the seed. The nearest shape is by D<sub>C</sub>; its camera differs."
    return pages.Section(
        "Samples", [pages.Figure("samples.webp", caption, "Samples of both GANs, and real images", sheet)]
    )


def _shapes(scores: Mapping[str, Any]) -> pages.Section:
    found, printed = scores["held_out"], cloud_scores.PRINTED
    ratio = found["encoded"]["chamfer_l2_sq_x1000"] / found["optimised"]["chamfer_l2_sq_x1000"]
    verdict = (
        f"Through the encoder D<sub>C</sub> of held-out shapes is {ratio:.2f} times that of latents optimised on each "
        f"shape; the aim is at most {RATIO}."
    )
    rows = [
        [label, *(f"{found[name][key]:.{metric.digits}f}" for key, metric in printed.items())]
        for name, label in _LATENTS.items()
    ]
    header = ["", *(str(metric.label) for metric in printed.values())]
    clouds = pages.Table("Held-out shapes: D<sub>C</sub> x 1000, F x 100.", header, rows)
    kl = scores["divergence"]
    said = (
        f"The divergence from the prior is {kl['sum']:.1f} nats a shape; {kl['used']} of {kl['dimensions']} dimensions "
        "have more than 0.1."
    )
    return pages.Section("Held-out shapes", [verdict, clouds, said])


def _prior(alike: Mapping[str, Any]) -> pages.Section:
    rows = []
    for key, label in (("prior", "samples of the prior"), ("learned", "learned shapes")):
        shares = [f"{100 * alike[key][share]:.0f}" for share in ("coverage", "told_apart")]
        rows.append([label, f"{alike[key]['matching_x1000']:.3f}", *shares])
    caption = (
        "As many shapes as were held out, against these. MMD: mean D<sub>C</sub> x 1000 of a held-out shape to the "
        "nearest. COV: held-out shapes that are the nearest to one of them, %. 1-NNA: shapes of both sets whose "
        "nearest other one is of their own set, %; 50 is best."
    )
    return pages.Section("Samples as a set", [pages.Table(caption, ["", "MMD ↓", "COV ↑", "1-NNA"], rows)])


def _images(
    scores: Mapping[str, Any], gan: generative_settings.GANConfig, section: generative_settings.ScoresConfig
) -> pages.Section:
    found, rows = scores["images"], []
    for name, label in _IMAGES.items():
        row = found["rows"][name]
        kid = f"{_shown(row['kid'])} ± {_shown(row['kid_spread'])}" if found["in_order"] else "not used"
        rows.append([label, kid, PAPER_FID.get(name, "–")])
    header = ["", "measured KID ↓", "paper, ShapeNet FID ↓"]
    shapes = scores["shapes"]["learned"] + scores["shapes"]["held_out"]
    caption = (
        f"KID x 1000 against {found['real']} real images. Features: a ResNet-20 of width {section.features.width}, "
        f"trained here for {section.features.steps} steps to tell {shapes} other shapes and their views apart. ±: "
        f"standard deviation over {section.subsets} subsets of {section.subset_size}. FID, paper, ShapeNet: [DDF22] "
        "§4.4, of other images and another network."
    )
    kids = ", ".join(f"{name} {_shown(found['rows'][name]['kid'])}" for name in ("ceiling", *found["spoiled"]))
    order = "are in" if found["in_order"] else "are not in"
    check = (
        f"KID of real images, spoiled: {kids}. They {order} the order that they must have"
        f"{'' if found['in_order'] else ', so KID is not used'}."
    )
    limit = (
        "What two cores cannot show: the paper's trainings have 100,000 steps of full-size networks; here the image "
        f"GANs have {gan.steps} steps of narrow ones, so image quality says nothing about the method's best."
    )
    return pages.Section("Images", [pages.Table(caption, header, rows), check, limit])


def _shown(kid: float) -> str:
    """KID x 1000 to three digits."""
    return f"{float(f'{1000 * kid:.3g}'):,.10g}"


def _trainings(run: Run) -> pages.Section:
    rows = [
        [label, f"{log[-1]['step']:,.0f}", f"{log[-1]['seconds'] / 60:.1f}", f"{log[-1]['loss']:.3f}"]
        for name, label in TRAININGS.items()
        if (log := training_loop.read_log(run.folder(name)))
    ]
    caption = "One process each. The losses are not of one kind."
    header = ["", "steps", "minutes", "last loss"]
    return pages.Section("Training", [pages.Table(caption, header, rows)])
