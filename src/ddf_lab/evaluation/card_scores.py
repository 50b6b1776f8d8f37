"""What the card of a reconstruction model says: its scores on a run's shapes, and how it tells its kind from others.

The kind is learned from public shapes of all categories. Positives are of the model's category, negatives of the
others: public ones of the training side whose licence asks for credit at most, and procedural ones. `HELD` categories
only test.
"""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from jaxtyping import Float
from torch import Tensor

from ddf.core import storage
from ddf.data import cutouts, shapenet
from ddf.data.batches import category_data
from ddf.data.public import manifest, packages, shapes
from ddf.data.synthetic import write
from ddf.models import line_field, out_of_distribution, reconstruction_settings
from ddf.reconstruction import framing, line_cameras, line_clouds
from ddf_lab.evaluation import groups, scoring
from ddf_lab.run import Run

LABEL = line_field.KIND  # of the scores
HELD = ("lamp", "bed")
SEED, VIEWS, PROCEDURAL = 99, 5, 60  # of the renders; shapes of each procedural category
Seen = tuple[str, bool, str, Path]  # category of a shape, whether it is learned from, its id, the folder of its renders


def measure(run: Run, folder: Path, kind: str) -> pd.Series:
    """Means of clouds L at the true, the predicted and the corrected camera, of the category's test shapes; by group,
    column and metric, as `scoring.summary` makes them.

    Args:
      folder: of the model with image features, trained or shipped. kind: `groups.REAL`, these alone, or empty.
    """
    section, index = run.section(reconstruction_settings.PointcloudsConfig), storage.read_json(run.index)
    dataset, samples = shapenet.Dataset.open(run.index), run.folder("samples")
    group = groups.of_shapes(index, run.category, "test")
    views = category_data.test_views(dataset, run.category, section.test_views, section.public_views)
    asked = [(name, own) for name, own in views if group[name].startswith(kind)]
    trained = line_field.load(folder)
    images = category_data.read_images(
        dataset, run.category, category_data.available(samples, asked), trained.image_size
    )
    tensors = line_clouds.reconstruct(trained.network, images, section)[0]
    tensors |= line_cameras.reconstruct(trained.network, images, section, tensors["camera_pred"])[0]
    known = {"camera_true": images.cameras}
    known |= category_data.read_shapes(samples, images.ids).placements(images.shapes)
    arrays = {name: value.numpy() for name, value in (known | tensors).items()}
    predictions = scoring.Predictions(folder, [(str(i["id"]), int(i["view"])) for i in images.names()], arrays, {})
    truths, clouds = scoring.load_truth(samples), {"Pi_g": "L.true", "Pi_pred": "L.pred", "Pi_corrected": "L.corrected"}
    cases = (
        (truths[image[0]], [scoring.Case(LABEL, camera, [image], predictions.cloud(cloud, row, camera))])
        for row, image in enumerate(predictions.images)
        for camera, cloud in clouds.items()
    )
    scores, cameras = scoring.score_all(cases, 1), scoring.camera_errors(LABEL, predictions)
    scores, cameras = (table.assign(category=table["id"].map(group)) for table in (scores, cameras))
    means = scoring.summary(scores, cameras, pd.DataFrame(columns=["category"]))
    return means.set_index(["category", "column", "metric"])["value"]


def tell_apart(folder: Path, category: str, renders: Path) -> str:
    """Add the direction that tells the kind to a model's file; how often the verdict is right, for its card.

    Args:
      folder: of the model. renders: folder that keeps the pictures.
    """
    trained = line_field.load(folder)
    assert trained.statistics is not None
    rows = [(seen, _features(trained, seen[3])) for seen in rendered(renders)]
    learn = [(seen, found) for seen, found in rows if seen[1]]
    own = [(seen[2], found) for seen, found in learn if seen[0] == category]
    direction, likeness = out_of_distribution.told_apart(
        torch.cat([found for _, found in own]),
        torch.cat([found for seen, found in learn if seen[0] != category]),
        [name for name, found in own for _ in found],
    )
    statistics = dataclasses.replace(trained.statistics, direction=direction, likeness=likeness)
    statistics.add_to(folder)
    tested = [(seen[0], statistics.score(found)) for seen, found in rows if not seen[1]]
    return _rates(category, tested)


def _rates(category: str, tested: Sequence[tuple[str, Float[np.ndarray, "views"]]]) -> str:
    """Which share of the pictures of each category is called none of the kind."""
    said = []
    for name in sorted({name for name, _ in tested}, key=lambda name: (name != category, name)):
        far = np.concatenate([score for kind, score in tested if kind == name]) >= out_of_distribution.FAR
        said.append(f"{far.mean():.0%} of {len(far)} {name}s")
    return f"`ddf reconstruct` calls no {category}: {', '.join(said)}, of shapes not learned from."


def rendered(root: Path) -> list[Seen]:
    """The shapes, whose pictures are drawn where they are not yet there."""
    found = []
    for row in manifest.rows():
        folder = shapenet.rendering_dir(root, shapenet.synset(row.category), row.id)
        if not (folder / shapenet.METADATA).exists():
            kept = packages.require(packages.PACKAGES[row.package], manifest.wanted(row.package))
            shapes.write_shape(root, SEED, kept, row, 0, VIEWS)
        learned = row.split == "train" and row.free and row.category not in HELD
        found.append((row.category, learned, row.id, folder))
    for category in write.WIDE:
        for index in range(PROCEDURAL):
            name = write.shape_id(SEED, category, index)
            folder = shapenet.rendering_dir(root, shapenet.synset(category), name)
            if not (folder / shapenet.METADATA).exists():
                write.write_shape(root, SEED, category, index, VIEWS, wide=True)
            found.append((category, True, name, folder))
    return found


@torch.no_grad()
def _features(trained: line_field.TrainedImageDDF, folder: Path) -> Float[Tensor, "views f"]:
    """Of the pictures of a shape."""
    pictures = [framing.Cutout(cutouts.read(path), framed=True) for path in sorted(folder.glob("*.png"))]
    crops = [framing.encoder_input(each.crop(framing.frame(trained, each), trained.image_size)) for each in pictures]
    return torch.cat(trained.network.shape_encoder.stages(torch.cat(crops)), dim=1)
