"""Real shapes: what models trained on other shapes make of the real test shapes of `ddf run real`.

Images, true clouds and the way of drawing clouds are those of the run; its stage `samples` must be done. The models are
those that come with the package, and those of `--models DIR`, a folder for each category; where there are several, each
is compared with the first, paired by shape. `--split validation` is for choices.

Errors: D_C and F(τ) with 5,000 points at the true camera and at the predicted one; azimuth error of the predicted
camera, median, and share over 90 degrees; IoU of the silhouette, from the predicted camera, with the image's.
"""

import argparse
import dataclasses
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import torch

from bench.lib import display, measuring
from ddf.core import shipped_models, storage
from ddf.data import shapenet
from ddf.data.batches import category_data
from ddf.metrics import cloud_scores
from ddf.models.reconstruction import inference, one_image, settings
from ddf.training import training_loop
from ddf_lab.evaluation import groups, paired, scoring
from ddf_lab.run import Run

ON_DEMAND = "python -m bench real_shapes, after the stage samples of `ddf run real`"
NAME = "real_shapes"
SHIPPED = Path("shipped")  # the models that come with the package
PRINTED = ("chamfer_l2_sq_x1000", "f_score_tau_x100")
CAMERA = ("azimuth_error_deg_median", "azimuth_turned_x100", "silhouette_iou")
SECTION = display.Section(views=())


@dataclasses.dataclass(frozen=True)
class Found:
    """Scores and camera errors per image, and seconds of a cloud, of one model on one category."""

    scores: pd.DataFrame
    cameras: pd.DataFrame
    seconds: float


def model_of(category: str, models: Path) -> Path:
    """The folder of a category's DDF."""
    return shipped_models.place(category) if models == SHIPPED else models / category


def measure(run: Run, label: str, folder: Path, split: str) -> Found:
    """Of the shapes of one split of the run's category."""
    section, index = run.section(settings.PointcloudsConfig), storage.read_json(run.index)
    section = dataclasses.replace(section, shape_correction=None, rendered=0)
    dataset, samples = shapenet.Dataset.open(run.index), run.folder("samples")
    group = groups.of_shapes(index, run.category, split)
    real = {name for name, own in group.items() if own.startswith(groups.REAL)}
    asked = [(name, own[: section.public_views]) for name, own in getattr(dataset, split)(run.category) if name in real]
    shown = category_data.available(samples, asked)
    model, size = one_image.load(folder)
    images = category_data.read_images(dataset, run.category, shown, size)
    tensors, facts = inference.reconstruct_ddf(model, images, section, f"{run.category} {label}")
    known = {"camera_true": images.cameras}
    known |= category_data.read_shapes(samples, images.ids).placements(images.shapes)
    arrays = {name: value.numpy() for name, value in (tensors | known).items()}
    predictions = scoring.Predictions(folder, [(str(i["id"]), int(i["view"])) for i in images.names()], arrays, {})
    truths, cloud = scoring.load_truth(samples), scoring.large_cloud(predictions)
    cases = (
        (truths[image[0]], [scoring.Case(label, f"{camera}-L", [image], predictions.cloud(cloud, row, camera))])
        for row, image in enumerate(predictions.images)
        for camera in ("Pi_g", "Pi_pred")
    )
    scores, cameras = scoring.score_all(cases, 1), scoring.camera_errors(label, predictions)
    scores, cameras = (table.assign(category=table["id"].map(group)) for table in (scores, cameras))
    return Found(scores, cameras, facts["seconds"]["cloud"])


def rows(found: dict[str, Found], split: str) -> Iterator[dict[str, Any]]:
    """A row of each group and model of one category."""
    every = pd.concat([own.scores for own in found.values()])
    cameras = pd.concat([own.cameras for own in found.values()])
    means = scoring.summary(every, cameras, pd.DataFrame(columns=["category"]))
    values = means.set_index(["category", "method", "column", "metric"])["value"]
    first = next(iter(found))
    for group in every["category"].unique():
        for label, own in found.items():
            error = {
                f"{metric}, {c}": values[group, label, f"{c}-L", metric]
                for c in ("Pi_g", "Pi_pred")
                for metric in PRINTED
            }
            error |= {metric: values[group, label, "Pi_pred", metric] for metric in CAMERA}
            for metric in PRINTED if label != first else ():
                heads = (label, "Pi_g-L"), (first, "Pi_g-L")
                gap = paired.difference([every], group, *heads, cloud_scores.METRICS[metric])
                if gap is not None:
                    error |= {f"{metric}, against {first}": gap.mean, f"{metric}, its error": gap.error}
            images = int((own.scores["category"] == group).sum() / 2)
            yield measuring.row(f"{group}, {split}: {label}", {"images": images}, [own.seconds], error)


def main(arguments: Sequence[str]) -> None:
    """Measure every category with every model that is there, and write the rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--run", default="real", help="the experiment (default %(default)s)")
    parser.add_argument("--split", choices=("test", "validation"), default="test")
    parser.add_argument(
        "--models", type=Path, action="append", default=[SHIPPED], help="folder by category; repeatable"
    )
    args = parser.parse_args(arguments)
    torch.set_num_threads(1)
    written = []
    for category in storage.read_json(Run.read(args.run).index)["categories"]:
        run = Run.read(args.run, category)
        places = {str(models): model_of(category, models) for models in args.models}
        there = {label: folder for label, folder in places.items() if (folder / training_loop.MODEL).is_file()}
        found = {label: measure(run, label, folder, args.split) for label, folder in there.items()}
        for row in rows(found, args.split):
            written.append(row)
            told = ", ".join(f"{name} {value:.3g}" for name, value in row["error"].items())
            print(f"{row['what']} ({row['size']['images']} images): {told}", flush=True)
    measuring.write(NAME, 1, written)
