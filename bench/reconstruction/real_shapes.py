"""Real shapes: what models trained on other shapes make of the real test shapes of `ddf run real`.

Images, true clouds and the way of drawing clouds are those of the run; its stage `samples` must be done. The models are
those that come with the package, and those of `--models DIR`, a folder for each category; where there are several, each
is compared with the first, paired by shape. `--split validation` is for choices.

Errors: D_C and F(τ) with 5,000 points at the true camera and at the predicted one; azimuth error of the predicted
camera, median, and share over 90 degrees; IoU of the silhouette, from the predicted camera, with the image's.
"""

from pathlib import Path
from typing import Annotated, Literal

import pandas as pd

from bench.lib import measuring
from ddf.cli.declare import Arg
from ddf.core import shipped_models, storage
from ddf.fields import model_files
from ddf.metrics import cloud_scores
from ddf_lab.evaluation import claims, groups, one_model
from ddf_lab.run import Run

KEPT = True  # rows of other models
SHIPPED = Path("shipped")  # the models that come with the package
PRINTED = ("chamfer_l2_sq_x1000", "f_score_tau_x100")
CAMERA = ("azimuth_error_deg_median", "azimuth_turned_x100", "silhouette_iou")


def model_of(category: str, models: Path) -> Path:
    """The folder of a category's DDF."""
    return shipped_models.place(category) if models == SHIPPED else models / category


def rows(found: dict[str, one_model.Found], split: str) -> measuring.Rows:
    """A row of each group and model of one category."""
    every = pd.concat([own.scores for own in found.values()])
    values = pd.concat([own.means() for own in found.values()])
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
                gap = claims.of_tables([every], group, *heads, cloud_scores.METRICS[metric])
                if gap is not None:
                    error |= {f"{metric}, against {first}": gap.mean, f"{metric}, its error": gap.error}
            images = int((own.scores["category"] == group).sum() / 2)
            yield measuring.row(f"{group}, {split}: {label}", {"images": images}, [own.seconds], error)


def main(
    *,
    run: str = "real",
    split: Literal["test", "validation"] = "test",
    models: Annotated[list[Path], Arg(action="append")] = [SHIPPED],  # noqa: B006 argparse copies it
) -> measuring.Rows:
    """Every category with every model that is there.

    Args:
      run: the experiment.
      split: its shapes.
      models: folder by category; repeatable.
    """
    for category in storage.read_json(Run.read(run).index)["categories"]:
        places = {str(folder): model_of(category, folder) for folder in models}
        there = {label: folder for label, folder in places.items() if (folder / model_files.MODEL).is_file()}
        own = Run.read(run, category)
        found = {label: one_model.measure(own, label, folder, split, groups.REAL) for label, folder in there.items()}
        yield from rows(found, split)
