"""Live pages of an experiment: of each category what DDF makes of three test images, side by side."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import torch

from ddf.core import checks
from ddf.data import shapenet
from ddf.fields import shape_field
from ddf.io import viewer_layout, viewer_page
from ddf.models import reconstruction_models
from ddf.reconstruction import one_image
from ddf_lab.report.experiment import example_strips
from ddf_lab.report.experiment.stage_results import Results
from ddf_lab.run import Run

NAMES = ("best", "median", "worst")
_ABOUT = "What DDF makes of three test images, with D_C × 1000 at the true camera; evaluated live by this page."


def drawn(run: Run, results: Results) -> Results:
    """The results with their live pages; without that of a category whose model is not there or cannot be read."""
    live = {}
    for group, category in results.groups.items():
        errors = example_strips.image_errors(results.per_image[results.per_image["category"] == group])
        folder = run.folder("train_ddf", category)
        root = (Path(results.index["root"]), results.index["categories"][category]["synset"])
        try:
            live[group] = viewer_page.render(page(group, folder, root, chosen(errors)))
        except (FileNotFoundError, checks.InputError):
            continue
    return dataclasses.replace(results, live=live)


def chosen(errors: Mapping[example_strips.Image, example_strips.Errors]) -> dict[str, example_strips.Image]:
    """Images of the smallest, the median (of an even number the smaller of both) and the largest error, by name."""
    ordered = sorted(errors, key=lambda image: (errors[image].ddf, image))
    rows = (0, (len(ordered) - 1) // 2, len(ordered) - 1)
    return {f"{name} {errors[ordered[row]].ddf:.3f}": ordered[row] for name, row in zip(NAMES, rows, strict=True)}


def page(
    category: str, folder: Path, root: tuple[Path, str], images: Mapping[str, example_strips.Image]
) -> viewer_page.Page:
    """The fields of some images, as the encoder alone gives them.

    Args:
      folder: of the model. root: of `shapenet.image_path`. images: by the names that the page shows.
    Raises:
      FileNotFoundError: there is no model, or no image. InputError: one is damaged; it is named.
    """
    model, image_size = one_image.load(folder)
    model = model.cpu()
    shapes = []
    for name, image in images.items():
        pixels = shapenet.read_image(shapenet.image_path(*root, *image), image_size)
        with torch.no_grad():
            _, latent, _ = reconstruction_models.encode_batch(model, pixels[None])
            modulations = [values[0] for values in model.modulations(latent)]
        shapes.append((name, shape_field.conditioned(model.field, modulations, 1.0)))
    return viewer_layout.row_page(f"{category.capitalize()}: {', '.join(NAMES)}", shapes, about=_ABOUT)
