"""Picture strips: test images by the error of DDF, and what all models predict."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float

from ddf.data import shapenet
from ddf.geometry import transforms
from ddf.metrics import camera_errors
from ddf.pictures import field_pictures, picture_strips
from ddf_lab.evaluation import scoring
from ddf_lab.report import scores
from ddf_lab.report.stage_results import Results
from ddf_lab.run import Run

Image = tuple[str, int]  # id of the shape, view
COLUMNS = ("input", "visibility", "depth", "normals", "truth", "DDF cloud", "PC-SIREN cloud", "DDF+image cloud")
EXAMPLES = 5  # of a category
_ORDERED_BY = "Pi_pred-L"  # the column whose D_C orders the images and stands beside them, which show it
Errors = Mapping[str, float]  # D_C x 1000 of an image, by method


def words(errors: Errors, turned_deg: Errors) -> str:
    """As printed beside a picture."""
    labels = scores.METHOD_LABELS
    return "; ".join(f"{labels[name]} {error:.3f}, {turned_deg[name]:.0f}°" for name, error in errors.items())


def drawn(run: Run, results: Results) -> Results:
    """The results with their pictures."""
    strips, rendered = {}, 0
    for name, category in results.groups.items():
        folder = run.folder("pointclouds", category)
        models = {
            method: scoring.load_predictions(folder / f"{file}.safetensors") for method, file in scoring.FILES.items()
        }
        errors = image_errors(results.per_image[results.per_image["category"] == name])
        ddf = models[scoring.DDF]
        places = {ddf.images[row]: place for place, row in enumerate(ddf.metadata["rendered"])}  # of the renders
        known = {image: errors[image] for image in places if image in errors}
        rendered = len(known)
        if not known:
            continue
        truths = scoring.load_truth(run.folder("samples", category))
        renderings = (Path(results.index["root"]), results.index["categories"][category]["synset"])
        rows = []
        for image, title in choose(known, EXAMPLES).items():
            picture = shapenet.read_image(shapenet.image_path(*renderings, *image), 137).permute(1, 2, 0).numpy()
            given = picture_strips.on_white(picture.astype(np.float64))
            cells = [given, *_cells(models, truths[image[0]].benchmark_points(), image, places[image])]
            told = words(known[image], {method: _turned_deg(model, image) for method, model in models.items()})
            heading = f"{title[0].upper()}{title[1:]}: D_C × 1000, azimuth off"
            rows.append(picture_strips.StripRow(heading, [told], cells))
        strips[name] = picture_strips.strip(COLUMNS, rows)
    return dataclasses.replace(results, strips=strips, rendered=rendered)


def image_errors(per_image: pd.DataFrame) -> dict[Image, Errors]:
    """Of every image of a category, at the predicted camera, L points.

    Args:
      per_image: rows of per_image.csv of one category.
    """
    rows = per_image[per_image["column"] == _ORDERED_BY]
    table = 1000.0 * rows.pivot(index=["id", "view"], columns="method", values="chamfer_l2_sq")
    return {image: row.to_dict() for image, row in table[list(scoring.FILES)].iterrows()}


def choose(errors: Mapping[Image, Errors], count: int) -> dict[Image, str]:
    """So many images at even percentiles of DDF's error, best first, and what each stands for; fewer of fewer."""
    ordered = sorted(errors, key=lambda image: (errors[image][scoring.DDF], image))
    names = {0: "smallest error of DDF", 50: "median error of DDF", 100: "largest error of DDF"}
    chosen: dict[Image, str] = {}
    for percent in np.linspace(0, 100, min(count, len(ordered))):
        image = ordered[round(percent / 100 * (len(ordered) - 1))]
        chosen[image] = names.get(percent, f"{percent:.0f} % of the errors of DDF")
    return chosen


def _turned_deg(model: scoring.Predictions, image: Image) -> float:
    """By how much the predicted azimuth is off."""
    row = model.images.index(image)
    guess, truth = (model.tensors[f"camera_{kind}"][row, :1] for kind in ("pred", "true"))
    return float(camera_errors.angle_difference_deg(guess, truth)[0])


def _cells(
    models: Mapping[str, scoring.Predictions], truth: Float[np.ndarray, "n 3"], image: Image, place: int
) -> list[picture_strips.Picture]:
    """The DDF's render, the true cloud, and the clouds of all models, each at its predicted camera and scale."""
    ddf = models[scoring.DDF]
    visibility, depth, normals = (
        ddf.tensors[f"render.{kind}"][place].astype(np.float64) for kind in ("visibility", "depth", "normals")
    )
    cells = [
        field_pictures.visibility_picture(visibility),
        field_pictures.depth_picture(depth, visibility),
        field_pictures.normals_picture(normals, visibility),
        _cloud(truth, truth, ddf.tensors["camera_true"][ddf.images.index(image)]),
    ]
    names = {scoring.DDF: scoring.large_cloud(ddf), scoring.PC_SIREN: "L", scoring.DDF_IMAGE: "L.pred"}
    for method, name in names.items():
        tensors, row = models[method].tensors, models[method].images.index(image)
        scale = transforms.BENCHMARK_FROM_V1 * float(tensors["scale_pred"][row])
        cells.append(_cloud(scale * tensors[name][row].astype(np.float64), truth, tensors["camera_pred"][row]))
    return cells


def _cloud(points: Float[np.ndarray, "n 3"], truth: Float[np.ndarray, "m 3"], camera: np.ndarray) -> np.ndarray:
    return picture_strips.cloud_picture(points, picture_strips.coordinate_colours(points, truth), camera)
