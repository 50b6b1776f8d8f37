"""What one reconstruction model, of any training, makes of the shapes of a run whose stage `samples` is done."""

import dataclasses
from pathlib import Path

import pandas as pd

from ddf.core import storage
from ddf.data import shapenet
from ddf.data.batches import category_data
from ddf.models import line_field, reconstruction_settings
from ddf.reconstruction import line_clouds, many_images
from ddf_lab.evaluation import groups, scoring
from ddf_lab.run import Run


@dataclasses.dataclass(frozen=True)
class Found:
    """Scores and camera errors per image, and seconds of a cloud, of one model on one category."""

    scores: pd.DataFrame
    cameras: pd.DataFrame
    seconds: float

    def means(self) -> pd.Series:
        """By group, method, column and metric, as `scoring.summary` makes them."""
        means = scoring.summary(self.scores, self.cameras, pd.DataFrame(columns=["category"]))
        return means.set_index(["category", "method", "column", "metric"])["value"]


def measure(run: Run, label: str, folder: Path, split: str, kind: str = "") -> Found:
    """Clouds L at the true and the predicted camera, of the shapes of one split of the run's category.

    Args:
      label: the method's name in the result. folder: of the DDF, with or without image features, trained or shipped.
      split: test, validation or train. kind: `groups.REAL` or `groups.PROCEDURAL`, these alone.
    """
    section, index = run.section(reconstruction_settings.PointcloudsConfig), storage.read_json(run.index)
    section = dataclasses.replace(section, shape_correction=None, rendered=0)
    dataset, samples = shapenet.Dataset.open(run.index), run.folder("samples")
    group = groups.of_shapes(index, run.category, split)
    views = category_data.test_views(dataset, run.category, section.test_views, section.public_views, split)
    asked = [(name, own) for name, own in views if group[name].startswith(kind)]
    shown = category_data.available(samples, asked)
    model, size, _ = line_field.load_any(folder)
    images = category_data.read_images(dataset, run.category, shown, size)
    if isinstance(model, line_field.ImageDDFModel):
        tensors, facts = line_clouds.reconstruct(model, images, section)
    else:
        tensors, facts = many_images.reconstruct_ddf(model, images, section, f"{run.category} {label}")
    known = {"camera_true": images.cameras}
    known |= category_data.read_shapes(samples, images.ids).placements(images.shapes)
    arrays = {name: value.numpy() for name, value in (known | tensors).items()}
    predictions = scoring.Predictions(folder, [(str(i["id"]), int(i["view"])) for i in images.names()], arrays, {})
    truths, clouds = scoring.load_truth(samples), {"Pi_g": "L.true", "Pi_pred": "L.pred"}
    if not isinstance(model, line_field.ImageDDFModel):
        clouds = dict.fromkeys(clouds, scoring.large_cloud(predictions))
    cases = (
        (truths[image[0]], [scoring.Case(label, f"{camera}-L", [image], predictions.cloud(cloud, row, camera))])
        for row, image in enumerate(predictions.images)
        for camera, cloud in clouds.items()
    )
    scores, cameras = scoring.score_all(cases, 1), scoring.camera_errors(label, predictions)
    scores, cameras = (table.assign(category=table["id"].map(group)) for table in (scores, cameras))
    return Found(scores, cameras, facts["seconds"]["cloud"])
