"""Scores of predicted clouds for every test image, and their means over images.

A *column* says which camera places the prediction and how many points it has: `Pi_g` the true camera on both sides,
`Pi_pred` the predicted camera and the scale estimated from the prediction, `Pi_corrected` the camera after gradient
descent on the mask; `-L` and `-S` the large and the small cloud (5,000 and 2,466 points in the paper). F-scores
depend on the number of predicted points, so the count is part of the column's name. All comparisons happen in the
benchmark frame (0.57 x v1), or in the true camera's frame, which is a rigid motion away and so gives the same scores.
Sources: [DDF22] table `si3dr`; docs/formats.md.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
import torch
from jaxtyping import Float

from ddf.core import schema, storage
from ddf.core.schema import fixed, setting
from ddf.data import packing
from ddf.geometry import cameras, neighbours, transforms
from ddf.metrics import cloud_scores
from ddf.metrics.camera_errors import ERRORS
from ddf.reconstruction import three_views

DDF, PC_SIREN, DDF_ONE_CYCLE, DDF_ON_MASK = "ddf", "pc_siren", "ddf_nh1", "ddf_on_mask"
DDF_IMAGE, THREE_VIEWS = "ddf_image", "_3views"  # the latter behind a method that is given three images of a shape
FILES = {DDF: "ddf", PC_SIREN: "pcsiren", DDF_IMAGE: "ddf_image"}  # of clouds, by method
CAMERA_COLUMNS = {"Pi_g": "camera_true", "Pi_corrected": "camera_corrected", "Pi_pred": "camera_pred"}
MEASURED = "measured"
TURNED_DEG = 90.0  # a camera so far off takes front for rear, another basin of the mask's loss
OVERLAP = "silhouette_iou"
TRUTH = ("truth", "test shapes")  # method and column of what the long table says of the true clouds
TRUTH_METRICS = {"hidden_share_percent": ("hidden_share", 100.0), "spacing_variation": ("spacing_variation", 1.0)}
TABLE_FIELDS = ("category", "method", "column", "metric", "value", "images", "seeds", "spread", "source")


@dataclass(frozen=True)
class EvaluateConfig(schema.Checked):
    """Section `evaluate`. seed: of the random subsets that stand for predictions in the baseline rows."""

    oracle_points: int = setting(2466, "by which training shapes are ranked for the oracle row", least=1)
    oracle_shortlist: int = setting(8, "of the best, compared in full", least=1)
    seed: int = fixed(0, least=0)


@dataclass(frozen=True)
class Predictions:
    """One model's clouds and cameras for the test images of a category, in the field frame.

    `clouds` maps names such as "L.h3" (DDF, three cycles) or "L" (PC-SIREN) to (image, point, 3); cameras are (image,
    3): azimuth_rad, elevation_rad, radius. `scale_true` and `centre_true` map the field to the v1 frame; a prediction
    is taken for centred there, as v1's shapes are, and has `scale_pred`.
    """

    path: Path
    images: Sequence[tuple[str, int]]
    tensors: Mapping[str, np.ndarray]
    metadata: Mapping

    def cloud(self, name: str, image: int, camera: str) -> Float[np.ndarray, "n 3"]:
        """One predicted cloud in the benchmark frame of the true camera, as the column's camera places it."""
        points = self.tensors[name][image].astype(np.float64)
        if camera == "Pi_g":
            v1 = float(self.tensors["scale_true"][image]) * points + self.tensors["centre_true"][image]
            return transforms.BENCHMARK_FROM_V1 * v1
        own = f"scale_pred.{name.partition('.')[2]}"  # of clouds that have a scale of their own
        scale = self.tensors[own if own in self.tensors else "scale_pred"][image]
        points = transforms.BENCHMARK_FROM_V1 * float(scale) * points
        before, after = (self.tensors[name][image] for name in (CAMERA_COLUMNS[camera], "camera_true"))
        return cameras.moved(points, _extrinsics(before), _extrinsics(after))


def _extrinsics(camera: Float[np.ndarray, "3"]) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3"]]:
    rotation, centre = cameras.extrinsics(*torch.from_numpy(np.asarray(camera, dtype=np.float64)))
    return rotation.numpy(), centre.numpy()


def load_predictions(path: Path | str) -> Predictions:
    """The clouds of one model and category."""
    tensors, metadata = storage.load_tensors(path)
    images = [(str(image["id"]), int(image["view"])) for image in metadata["images"]]
    return Predictions(Path(path), images, tensors, metadata)


def load_truth(samples_dir: Path | str) -> dict[str, packing.Cloud]:
    """Ground-truth clouds of a category by shape id, from the files that the shards' records name."""
    clouds: dict[str, packing.Cloud] = {}
    for path in storage.shard_files(samples_dir, ".clouds.safetensors", "samples"):
        tensors, metadata = storage.load_tensors(path)
        clouds |= {shape: packing.Cloud.stored(tensors, row) for row, shape in enumerate(metadata["ids"])}
    return clouds


def columns(
    ddf: Predictions, pc_siren: Predictions, ddf_image: Predictions
) -> list[tuple[str, str, Predictions, str, str]]:
    """(method, column, predictions, cloud name, camera) of the paper's columns that the files hold."""
    cycles, both = _cycles(ddf), ("Pi_g", "Pi_pred")
    most = f".h{cycles[-1]}"
    found = [(DDF, camera, ddf, most, "LS") for camera in CAMERA_COLUMNS]
    found += [(PC_SIREN, camera, pc_siren, "", "LS") for camera in CAMERA_COLUMNS]
    own = zip(CAMERA_COLUMNS, (".true", ".corrected", ".pred"), strict=True)
    found += [(DDF_IMAGE, camera, ddf_image, name, "LS") for camera, name in own]
    found = [each for each in found if CAMERA_COLUMNS[each[1]] in each[2].tensors]
    if 1 in cycles and len(cycles) > 1:
        found += [(DDF_ONE_CYCLE, camera, ddf, ".h1", "LS") for camera in both]
    if "L.mask" in ddf.tensors:
        found += [(DDF_ON_MASK, camera, ddf, ".mask", "LS") for camera in both]
    return [
        (method, f"{camera}-{size}", predictions, size + name, camera)
        for method, camera, predictions, name, sizes in found
        for size in sizes
    ]


def _cycles(ddf: Predictions) -> list[int]:
    """The numbers of cycles N_H for which there are clouds, ascending."""
    return sorted(int(name.partition(".h")[2]) for name in ddf.tensors if name.startswith("L.h"))


def large_cloud(ddf: Predictions) -> str:
    """Name of DDF's large cloud after all cycles."""
    return f"L.h{_cycles(ddf)[-1]}"


def cloud_sizes(pc_siren: Predictions) -> dict[str, int]:
    """Points per size letter of the columns' names."""
    return {size: pc_siren.tensors[size].shape[1] for size in "LS"}


@dataclass(frozen=True)
class Case:
    """One prediction to be compared with the truth of its shape, and the images for which the result stands."""

    method: str
    column: str
    images: Sequence[tuple[str, int]]
    prediction: Float[np.ndarray, "n 3"]


def views_by_shape(images: Sequence[tuple[str, int]]) -> dict[str, list[int]]:
    """Rows of the images of every shape, in the order of first appearance."""
    rows: dict[str, list[int]] = {}
    for row, (shape, _) in enumerate(images):
        rows.setdefault(shape, []).append(row)
    return rows


def model_cases(models: Mapping[str, Predictions], shape: str) -> list[Case]:
    """The cases of all models for the images of one shape.

    Args:
      models: by method.
    """
    found = [
        Case(method, column, [predictions.images[row]], predictions.cloud(name, row, camera))
        for method, column, predictions, name, camera in columns(*(models[method] for method in FILES))
        for row in views_by_shape(predictions.images).get(shape, [])
    ]
    for method, predictions in models.items():
        if shape in (having := predictions.metadata.get(three_views.CLOUDS, [])):
            cloud = predictions.tensors[three_views.CLOUDS][having.index(shape)].astype(np.float64)
            image = predictions.images[views_by_shape(predictions.images)[shape][0]]
            found.append(Case(method + THREE_VIEWS, "Pi_g-L", [image], transforms.BENCHMARK_FROM_V1 * cloud))
    return found


def score_all(cases: Iterable[tuple[packing.Cloud, Sequence[Case]]], jobs: int | None = None) -> pd.DataFrame:
    """One row per case and image. Shapes are spread over processes as they come; each truth is indexed once. InputError
    names method, column and image.
    """
    tasks = (joblib.delayed(_score_shape)(shape_cases, truth) for truth, shape_cases in cases)
    rows = joblib.Parallel(n_jobs=jobs or joblib.cpu_count())(tasks)
    return pd.DataFrame([row for shape_rows in rows for row in shape_rows])


def _score_shape(cases: Sequence[Case], truth: packing.Cloud) -> list[dict]:
    tree = neighbours.Neighbours(truth.benchmark_points(), f"truth of {cases[0].images[0][0]}")
    rows = []
    for case in cases:
        name = f"{case.method} {case.column} of {case.images[0][0]} view {case.images[0][1]:02d}"
        scores = cloud_scores.compare_clouds(neighbours.Neighbours(case.prediction, name), tree).to_dict()
        rows += [{"method": case.method, "column": case.column, "id": i, "view": v, **scores} for i, v in case.images]
    return rows


def camera_errors(method: str, predictions: Predictions) -> pd.DataFrame:
    """Absolute errors of predicted and corrected cameras and of the scale, one row per image and column, each with the
    true azimuth in [0, 360).
    """
    truth = predictions.tensors["camera_true"].astype(np.float64)
    scale_ratio = predictions.tensors["scale_pred"].astype(np.float64) / predictions.tensors["scale_true"]
    ids, views = ([image[part] for image in predictions.images] for part in (0, 1))
    tables = []
    for column in ("Pi_pred", "Pi_corrected"):
        if CAMERA_COLUMNS[column] not in predictions.tensors:
            continue
        guess = predictions.tensors[CAMERA_COLUMNS[column]].astype(np.float64)
        table = {"method": method, "column": column, "id": ids, "view": views}
        table |= {"azimuth_deg": np.degrees(truth[:, 0]) % 360.0}
        table |= {name: error.compute(guess, truth, scale_ratio) for name, error in ERRORS.items()}
        table[OVERLAP] = predictions.tensors.get(OVERLAP, np.nan) if column == "Pi_pred" else np.nan
        tables.append(pd.DataFrame(table))
    return pd.concat(tables, ignore_index=True)


def summary(per_image: pd.DataFrame, camera_table: pd.DataFrame, shapes: pd.DataFrame) -> pd.DataFrame:
    """The long table: means of scores over images, medians of camera errors, the share of those turned round, the mean
    overlap of silhouettes, and of the true clouds the share of hidden points and the variation of the spacing.

    `spread` is the standard error over images (one seed was trained; it says nothing about other seeds).
    """
    rows: list[tuple] = []

    def add(head: tuple, metric: str, values: pd.Series, of: Callable = np.mean, spread: bool = False) -> None:
        array = values.to_numpy(dtype=np.float64)
        error = array.std(ddof=1) / np.sqrt(len(array)) if spread and len(array) > 1 else np.nan
        rows.append((*head, metric, of(array), len(array), 1, error, MEASURED))

    keys = ["category", "method", "column"]
    for head, group in per_image.groupby(keys, sort=False):
        for metric in cloud_scores.METRICS.values():
            add(head, metric.name, metric.factor * group[metric.score], spread=True)
    for head, group in camera_table.groupby(keys, sort=False):
        for name in ERRORS:
            add(head, f"{name}_median", group[name], np.median)
        for name, values in {
            "azimuth_turned_x100": 100.0 * (group["azimuth_error_deg"] > TURNED_DEG),
            OVERLAP: group[OVERLAP],
        }.items():
            if not values.isna().any():
                add(head, name, values, spread=True)
    for category, group in shapes.groupby("category", sort=False):
        for metric, (name, factor) in TRUTH_METRICS.items():
            add((category, *TRUTH), metric, factor * group[name])
    return pd.DataFrame(rows, columns=list(TABLE_FIELDS))
