"""Picture strips: test images by the error of DDF, and what all models predict."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from ddf.data import packing, shapenet
from ddf.geometry import transforms
from ddf.pictures import field_pictures, picture_strips
from ddf_lab.evaluation import scoring
from ddf_lab.report import scores
from ddf_lab.report.stage_results import Results
from ddf_lab.run import Run

Image = tuple[str, int]  # id of the shape, view
COLUMNS = ("input", "visibility", "depth", "normals", "truth", "DDF cloud", "PC-SIREN cloud", "DDF+image")
EXAMPLES = 5  # of a category
_ORDERED_BY = "Pi_g-L"  # the column whose D_C orders the images


Errors = Mapping[str, float]  # D_C x 1000 of an image, by method


class Clouds(NamedTuple):
    """What the pictures of a category are drawn from. models: by method."""

    models: Mapping[str, scoring.Predictions]
    truths: Mapping[str, packing.Cloud]
    image_root: tuple[Path, str]


def words(errors: Errors) -> str:
    """As printed beside a picture."""
    return "D_C × 1000: " + ", ".join(f"{scores.METHOD_LABELS[method]} {value:.3f}" for method, value in errors.items())


def drawn(run: Run, results: Results) -> Results:
    """The results with their pictures."""
    strips, rendered = {}, 0
    for name, category in results.groups.items():
        folder = run.folder("pointclouds", category)
        models = {
            method: scoring.load_predictions(folder / f"{file}.safetensors") for method, file in scoring.FILES.items()
        }
        truths = scoring.load_truth(run.folder("samples", category))
        synset = results.index["categories"][category]["synset"]
        clouds = Clouds(models, truths, (Path(results.index["root"]), synset))
        errors = image_errors(results.per_image[results.per_image["category"] == name])
        images = [image for image in _rendered(models[scoring.DDF]) if image in errors]
        rendered = len(images)
        if images:
            strips[name] = strip(clouds, errors, choose({image: errors[image] for image in images}, EXAMPLES))
    return dataclasses.replace(results, strips=strips, rendered=rendered)


def image_errors(per_image: pd.DataFrame) -> dict[Image, Errors]:
    """Of every image of a category, at the true camera, L points.

    Args:
      per_image: rows of per_image.csv of one category.
    """
    rows = per_image[per_image["column"] == _ORDERED_BY]
    table = 1000.0 * rows.pivot(index=["id", "view"], columns="method", values="chamfer_l2_sq")
    return {image: row.to_dict() for image, row in table[list(scoring.FILES)].iterrows()}


def _rendered(ddf: scoring.Predictions) -> list[Image]:
    """The images of which there are renders."""
    return [ddf.images[row] for row in ddf.metadata["rendered"]]


def choose(errors: Mapping[Image, Errors], count: int) -> dict[Image, str]:
    """So many images at even percentiles of DDF's error, best first, and what each stands for; fewer of fewer."""
    ordered = sorted(errors, key=lambda image: (errors[image][scoring.DDF], image))
    names = {0: "smallest error of DDF", 50: "median error of DDF", 100: "largest error of DDF"}
    chosen: dict[Image, str] = {}
    for percent in np.linspace(0, 100, min(count, len(ordered))):
        image = ordered[round(percent / 100 * (len(ordered) - 1))]
        chosen[image] = names.get(percent, f"{percent:.0f} % of the errors of DDF")
    return chosen


def strip(clouds: Clouds, errors: Mapping[Image, Errors], chosen: Mapping[Image, str]) -> bytes:
    """As WebP. Predictions are seen from the predicted camera at the predicted scale, as in the paper."""
    ddf = clouds.models[scoring.DDF]
    rendered = _rendered(ddf)
    rows = []
    for image, name in chosen.items():
        place = rendered.index(image)
        visibility, depth, normals = (
            ddf.tensors[f"render.{kind}"][place].astype(np.float64) for kind in ("visibility", "depth", "normals")
        )
        views = [
            field_pictures.visibility_picture(visibility),
            field_pictures.depth_picture(depth, visibility),
            field_pictures.normals_picture(normals, visibility),
        ]
        given, *ours, truth = _cells(clouds, image)
        cells = [given, *views, truth, *ours]
        rows.append(picture_strips.StripRow(name[0].upper() + name[1:], [words(errors[image])], cells))
    return picture_strips.strip(COLUMNS, rows)


def _cells(clouds: Clouds, image: Image) -> list[picture_strips.Picture]:
    """Input, the clouds of DDF, PC-SIREN and the model with image features, true cloud."""
    rgba = shapenet.read_image(shapenet.image_path(*clouds.image_root, *image), 137).permute(1, 2, 0).numpy()
    reference = clouds.truths[image[0]].benchmark_points()
    ddf = clouds.models[scoring.DDF]
    camera = ddf.tensors["camera_true"][ddf.images.index(image)]
    names = {scoring.DDF: scoring.large_cloud(ddf), scoring.PC_SIREN: "L", scoring.DDF_IMAGE: "L.pred"}
    return [
        picture_strips.on_white(rgba.astype(np.float64)),
        *(_own_view(clouds.models[method], name, image, reference) for method, name in names.items()),
        picture_strips.cloud_picture(reference, picture_strips.coordinate_colours(reference, reference), camera),
    ]


def _own_view(model: scoring.Predictions, name: str, image: Image, reference: np.ndarray) -> picture_strips.Picture:
    """A predicted cloud in its predicted camera and scale."""
    row = model.images.index(image)
    scale = transforms.BENCHMARK_FROM_V1 * float(model.tensors["scale_pred"][row])
    points = scale * model.tensors[name][row].astype(np.float64)
    return picture_strips.cloud_picture(
        points, picture_strips.coordinate_colours(points, reference), model.tensors["camera_pred"][row]
    )
