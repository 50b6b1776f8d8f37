"""Trained models of an experiment on the first view of its first test shapes, and the clouds that are true there."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ddf.data import shapenet
from ddf.data.batches import category_data
from ddf.geometry import transforms
from ddf.metrics import metrics
from ddf.models.reconstruction import reconstruction_models, settings
from ddf.training import training_loop
from ddf_lab.run import Run


@dataclass(frozen=True)
class Views:
    """Images, and for each of them the field's scale, the factor from field to benchmark units, and the true cloud.

    truths: float64, benchmark units.
    """

    images: category_data.ImageSet
    field_scales: list[float]
    factors: list[float]
    truths: list[np.ndarray]

    def scores(self, image: int, points: np.ndarray) -> dict[str, float]:
        """Errors of a cloud in field units against the truth of an image, as tables print them."""
        found = metrics.compare_clouds(points.astype(np.float64) * self.factors[image], self.truths[image])
        return {"chamfer_l2_sq_x1000": 1e3 * found.chamfer_l2_sq, "f_score_tau_x100": 100 * found.f_score_tau}


def trained(run: Run, category: str) -> bool:
    """Whether the experiment's DDF of a category is there."""
    return (run.folder("train_ddf", category) / training_loop.MODEL).exists()


def read(run: Run, category: str, count: int, models: Mapping[str, reconstruction_models.ReconstructionModel]) -> Views:
    """The first `count` test shapes; the weights of the models, by stage, are loaded.

    Raises:
      FileNotFoundError, InputError: a stage has not run, or left a damaged file; it is named.
    """
    train = run.section(settings.TrainConfig)
    for name, model in models.items():
        training_loop.load_model(model, run.folder(name, category))
    dataset = shapenet.Dataset.open(run.index)
    samples = run.folder("samples", category)
    shown = category_data.available(samples, category_data.test_views(dataset, category, 1))[:count]
    images = category_data.read_images(dataset, category, shown, train.image_size)
    shapes = category_data.read_shapes(samples, images.ids)
    scales = shapes.field_scales(images.shapes).tolist()
    factors = [transforms.BENCHMARK_FROM_V1 / scale for scale in scales]
    truths = [
        shapes.clouds[shape].numpy().astype(np.float64) * factor
        for shape, factor in zip(images.shapes, factors, strict=True)
    ]
    return Views(images, scales, factors, truths)
