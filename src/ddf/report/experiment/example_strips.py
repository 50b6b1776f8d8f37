"""Picture strips of a category: examples from best to worst, in the columns of the paper's figure."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from ddf.data import shapenet
from ddf.evaluation import scoring
from ddf.geometry import transforms
from ddf.report import picture_strips

COLUMNS = ("input", "visibility", "depth", "normals", "DDF cloud", "PC-SIREN cloud", "truth")
_PREFERRED = "Pi_g-L"  # the column whose D_C orders the examples


def examples(
    scores: pd.DataFrame, rendered: Sequence[tuple[str, int]], count: int
) -> list[tuple[str, tuple[str, int]]]:
    """Names and images at even steps of the order by DDF's D_C at Pi_g-L, best first, among the rendered images.

    Args:
      scores: rows of per_image.csv of one category.
    """
    chosen = scores[(scores["method"] == scoring.DDF) & (scores["column"] == _PREFERRED)]
    by_image = {(row["id"], row["view"]): row["chamfer_l2_sq"] for row in chosen.to_dict("records")}
    ordered = sorted(rendered, key=lambda image: (by_image[image], image))
    count = min(count, len(ordered))
    places = np.linspace(0, len(ordered) - 1, count).round().astype(int)
    return [(_quantile_name(i, count), ordered[place]) for i, place in enumerate(places)]


def _quantile_name(index: int, count: int) -> str:
    if index == 0:
        return "best"
    if index == count - 1:
        return "worst"
    return "median" if 2 * index == count - 1 else f"{100 * index / (count - 1):.0f} % point"


def strip(
    ddf: scoring.Predictions,
    pc_siren: scoring.Predictions,
    truths: Mapping[str, scoring.TruthCloud],
    image_root: tuple[Path, str],
    scores: pd.DataFrame,
    count: int,
) -> bytes:
    """The strip as WebP. Predictions are seen from the predicted camera at the predicted scale, as in the paper.

    Args:
      image_root: root of the data set and synset of the category.
      count: rows.
    """
    rendered = [ddf.images[i] for i in ddf.metadata["rendered"]]
    values = {
        (row["method"], row["id"], row["view"]): row["chamfer_l2_sq"]
        for row in scores[scores["column"] == _PREFERRED].to_dict("records")
    }
    rows = []
    for name, image in examples(scores, rendered, count):
        lines = ["D_C × 1000:"]
        for method, label in ((scoring.DDF, "DDF"), (scoring.PC_SIREN, "PC-SIREN")):
            lines.append(f"{label} {1000 * values[method, *image]:.3f}")
        cells = _cells(ddf, pc_siren, truths[image[0]], image_root, image, rendered.index(image))
        rows.append(picture_strips.StripRow(name, lines, cells))
    return picture_strips.strip(COLUMNS, rows)


def _cells(
    ddf: scoring.Predictions,
    pc_siren: scoring.Predictions,
    truth: scoring.TruthCloud,
    image_root: tuple[Path, str],
    image: tuple[str, int],
    rendered_row: int,
) -> list[picture_strips.Picture]:
    rgba = shapenet.read_image(shapenet.image_path(*image_root, *image), 137).permute(1, 2, 0).numpy()
    visibility, depth, normals = (
        ddf.tensors[f"render.{name}"][rendered_row].astype(np.float64) for name in ("visibility", "depth", "normals")
    )
    reference = truth.benchmark_points()
    names = (scoring.large_cloud(ddf), "L")
    clouds = [_own_view(model, name, image, reference) for model, name in zip((ddf, pc_siren), names, strict=True)]
    camera = ddf.tensors["camera_true"][ddf.images.index(image)]
    return [
        picture_strips.on_white(rgba.astype(np.float64)),
        picture_strips.visibility_picture(visibility),
        picture_strips.depth_picture(depth, visibility),
        picture_strips.normals_picture(normals, visibility),
        *clouds,
        picture_strips.cloud_picture(reference, picture_strips.coordinate_colours(reference, reference), camera),
    ]


def _own_view(
    model: scoring.Predictions, name: str, image: tuple[str, int], reference: np.ndarray
) -> picture_strips.Picture:
    """A predicted cloud in its predicted camera and scale."""
    row = model.images.index(image)
    scale = transforms.BENCHMARK_FROM_V1 * float(model.tensors["scale_pred"][row])
    points = scale * model.tensors[name][row].astype(np.float64)
    return picture_strips.cloud_picture(
        points, picture_strips.coordinate_colours(points, reference), model.tensors["camera_pred"][row]
    )
