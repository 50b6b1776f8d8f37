"""Picture strips: test images by the error of DDF and by the gap between the models, and what all models predict."""

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
from ddf_lab.report.stage_results import Results
from ddf_lab.run import Run

Image = tuple[str, int]  # id of the shape, view
COLUMNS = ("input", "visibility", "depth", "normals", "truth", "DDF cloud", "PC-SIREN cloud", "DDF+image")
EXAMPLES = 3  # of a category, by the error of DDF; and as many by the difference
FIRST_COLUMNS = ("input", "DDF", "PC-SIREN", "DDF+image", "truth")
_ORDERED_BY = "Pi_g-L"  # the column whose D_C orders the images


class Errors(NamedTuple):
    """D_C x 1000 of the models for one image."""

    ddf: float
    pc_siren: float
    ddf_image: float

    def words(self) -> str:
        """As printed beside a picture."""
        both = f"DDF {self.ddf:.3f}, PC-SIREN {self.pc_siren:.3f}"
        return f"D_C × 1000: {both}, DDF+image {self.ddf_image:.3f}"


class Clouds(NamedTuple):
    """What the pictures of a category are drawn from."""

    ddf: scoring.Predictions
    pc_siren: scoring.Predictions
    ddf_image: scoring.Predictions
    truths: Mapping[str, packing.Cloud]
    image_root: tuple[Path, str]


def drawn(run: Run, results: Results) -> Results:
    """The results with their pictures."""
    strips, first, rendered = {}, [], 0
    for name, category in results.groups.items():
        folder = run.folder("pointclouds", category)
        ours, theirs, third = (
            scoring.load_predictions(folder / f"{file}.safetensors") for file in scoring.FILES.values()
        )
        truths = scoring.load_truth(run.folder("samples", category))
        synset = results.index["categories"][category]["synset"]
        clouds = Clouds(ours, theirs, third, truths, (Path(results.index["root"]), synset))
        errors = image_errors(results.per_image[results.per_image["category"] == name])
        first.append(_first_row(name, clouds, errors))
        images = [image for i in clouds.ddf.metadata["rendered"] if (image := clouds.ddf.images[i]) in errors]
        rendered = len(images)
        if images:
            strips[name] = strip(clouds, errors, choose({image: errors[image] for image in images}, EXAMPLES))
    examples = picture_strips.strip(FIRST_COLUMNS, first, len(FIRST_COLUMNS))
    return dataclasses.replace(results, strips=strips, rendered=rendered, examples=examples)


def image_errors(per_image: pd.DataFrame) -> dict[Image, Errors]:
    """Of every image of a category, at the true camera, L points.

    Args:
      per_image: rows of per_image.csv of one category.
    """
    rows = per_image[per_image["column"] == _ORDERED_BY]
    table = 1000.0 * rows.pivot(index=["id", "view"], columns="method", values="chamfer_l2_sq")
    rows = zip(*(table[method] for method in scoring.FILES), strict=True)
    return {image: Errors(*row) for image, row in zip(table.index, rows, strict=True)}


def choose(errors: Mapping[Image, Errors], count: int) -> dict[Image, str]:
    """Images and what each stands for: at even percentiles of DDF's error, best first, then at even percentiles of the
    difference between the models, DDF's clearest win first. One that is both is there once, with both names.

    Args:
      count: of either; fewer where there are fewer images.
    """
    count = min(count, len(errors))
    gaps = {image: own.ddf - own.pc_siren for image, own in errors.items()}
    orders = (
        ({image: own.ddf for image, own in errors.items()}, ("smallest error of DDF", "largest error of DDF"), "error"),
        (
            gaps,
            (
                "DDF farthest ahead" if min(gaps.values()) < 0 else "DDF least behind",
                "DDF farthest behind" if max(gaps.values()) > 0 else "DDF least ahead",
            ),
            "difference",
        ),
    )
    chosen: dict[Image, str] = {}
    for values, ends, quantity in orders:
        ordered = sorted(values, key=lambda image: (values[image], image))
        for percent in np.linspace(0, 100, count):
            image = ordered[round(percent / 100 * (len(ordered) - 1))]
            between = f"median {quantity}" if percent == 50 else f"{percent:.0f} % of the {quantity}s"
            name = ends[0] if percent == 0 else ends[1] if percent == 100 else between
            chosen[image] = f"{chosen[image]}; {name}" if image in chosen else name
    return chosen


def strip(clouds: Clouds, errors: Mapping[Image, Errors], chosen: Mapping[Image, str]) -> bytes:
    """As WebP. Predictions are seen from the predicted camera at the predicted scale, as in the paper."""
    rendered = [clouds.ddf.images[i] for i in clouds.ddf.metadata["rendered"]]
    rows = []
    for image, name in chosen.items():
        place = rendered.index(image)
        visibility, depth, normals = (
            clouds.ddf.tensors[f"render.{kind}"][place].astype(np.float64)
            for kind in ("visibility", "depth", "normals")
        )
        views = [
            field_pictures.visibility_picture(visibility),
            field_pictures.depth_picture(depth, visibility),
            field_pictures.normals_picture(normals, visibility),
        ]
        given, *ours, truth = _cells(clouds, image)
        cells = [given, *views, truth, *ours]
        rows.append(picture_strips.StripRow(name[0].upper() + name[1:], [errors[image].words()], cells))
    return picture_strips.strip(COLUMNS, rows)


def _first_row(category: str, clouds: Clouds, errors: Mapping[Image, Errors]) -> picture_strips.StripRow:
    """The image whose error of DDF is the median (of an even number the smaller of both)."""
    ordered = sorted(errors, key=lambda image: (errors[image].ddf, image))
    image = ordered[(len(ordered) - 1) // 2]
    return picture_strips.StripRow(category.capitalize(), [errors[image].words()], _cells(clouds, image))


def _cells(clouds: Clouds, image: Image) -> list[picture_strips.Picture]:
    """Input, the clouds of DDF, PC-SIREN and the model with image features, true cloud."""
    rgba = shapenet.read_image(shapenet.image_path(*clouds.image_root, *image), 137).permute(1, 2, 0).numpy()
    reference = clouds.truths[image[0]].benchmark_points()
    camera = clouds.ddf.tensors["camera_true"][clouds.ddf.images.index(image)]
    return [
        picture_strips.on_white(rgba.astype(np.float64)),
        _own_view(clouds.ddf, scoring.large_cloud(clouds.ddf), image, reference),
        _own_view(clouds.pc_siren, "L", image, reference),
        _own_view(clouds.ddf_image, "L.pred", image, reference),
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
