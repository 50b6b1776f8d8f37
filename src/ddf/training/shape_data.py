"""Which shapes of a category the VAE learns, which test it, and whose images the critic sees; samples and clouds.

The shapes with samples are the VAE's. The critic sees images of the others, so that no shape is on both sides.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from torch import Tensor

from ddf.core import checks, storage
from ddf.data import shapenet
from ddf.data.batches import category_data
from ddf.models import image_networks

SURFACE = "S"  # samples whose starts lie on the surface, evenly, with its normals


@dataclass(frozen=True)
class Parts:
    """Ids of a category's shapes: learned and held out by the VAE, and pictured for the critic."""

    learned: Sequence[str]
    held_out: Sequence[str]
    pictured: Sequence[str]


def parts(index_path: Path, samples_dir: Path, category: str, held_out: int) -> Parts:
    """The parts of a category, each in the order of the data set; the last shapes with samples are held out. InputError
    where fewer than two would be left to learn.
    """
    having, others = _with_samples(index_path, samples_dir, category)
    if len(having) - held_out < 2:
        raise checks.InputError(
            f"{samples_dir}: {len(having)} shapes have samples, of which vae.held_out takes {held_out}; make more, or "
            "hold out fewer"
        )
    return Parts(having[:-held_out], having[-held_out:], others)


def _with_samples(index_path: Path, samples_dir: Path, category: str) -> tuple[list[str], list[str]]:
    """Ids of the shapes that have samples, and of the others."""
    shapes = [shape.id for shape in shapenet.Dataset.open(index_path).category(category).shapes]
    sampled = {name for name, _ in category_data.available(samples_dir, [(name, ()) for name in shapes])}
    return [name for name in shapes if name in sampled], [name for name in shapes if name not in sampled]


def read_pictured(index_path: Path, samples_dir: Path, category: str) -> tuple[category_data.ImageSet, list[Path]]:
    """Images of the shapes without samples, and the files that say which these are; InputError where there are none."""
    _, others = _with_samples(index_path, samples_dir, category)
    if not others:
        raise checks.InputError(
            f"{samples_dir}: every shape has samples, so that none is left for the critic's images; meshes.shapes must "
            "be less than the shapes of the category"
        )
    return _read_images(index_path, samples_dir, category, others)


def read_sampled(
    index_path: Path, samples_dir: Path, category: str, views: int | None = None
) -> tuple[category_data.ImageSet, list[Path]]:
    """Images of the shapes with samples, all or the first `views` of each, as `read_pictured`."""
    having, _ = _with_samples(index_path, samples_dir, category)
    return _read_images(index_path, samples_dir, category, having, views)


def _read_images(
    index_path: Path, samples_dir: Path, category: str, ids: Sequence[str], views: int | None = None
) -> tuple[category_data.ImageSet, list[Path]]:
    dataset = shapenet.Dataset.open(index_path)
    shown = [(name, range(len(dataset.cameras(category, name)))[:views]) for name in ids]
    images = category_data.read_images(dataset, category, shown, image_networks.IMAGE_SIZE)
    return images, [index_path, *storage.shard_files(samples_dir, category_data.SAMPLES, "samples")]


@dataclass(frozen=True)
class Shapes:
    """Samples of some shapes, and field units per v1 unit of each."""

    ids: Sequence[str]
    samples: category_data.SampleSet
    scales: Float[np.ndarray, "shapes"]

    def clouds(
        self, shapes: Int[np.ndarray, "b"], count: int, random: np.random.Generator
    ) -> tuple[Float[Tensor, "b count 3"], Float[Tensor, "b count 3"]]:
        """Random surface points of each shape with the surface's normals, field frame."""
        rows = random.integers(0, self.samples.stored[SURFACE], (len(shapes), count))
        found = self.samples.decoded(shapes, {SURFACE: rows})
        return found["positions"], found["normals"]


def read(samples_dir: Path, ids: Sequence[str]) -> tuple[Shapes, list[Path]]:
    """Samples of the given shapes, and the files that they come from."""
    scales = category_data.read_shapes(samples_dir, ids).field_scales(np.arange(len(ids)))
    found = Shapes(ids, category_data.read_samples(samples_dir, ids), scales.numpy())
    return found, storage.shard_files(samples_dir, category_data.SAMPLES, "samples")
