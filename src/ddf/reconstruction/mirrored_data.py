"""A training set with the mirror image of every shape, seen by the flipped images: twice the data, exact (ours).

Flipped from left to right, an image shows the mirror image of its shape, about any plane that holds the up axis, from
the mirrored camera (`cameras.mirrored`), but for lights that do not move with it. Number i + n is the mirror image of
number i of n. Nothing is stored: images, clouds and samples are turned when they are asked for.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float, Int, UInt8
from torch import Tensor

from ddf.data.samples import sample_batch
from ddf.geometry import cameras
from ddf.reconstruction import category_data, training_steps


@dataclass(frozen=True)
class _Images:
    images: category_data.Numbered[UInt8[Tensor, "4 size size"]]
    count: int

    def __getitem__(self, index: int, /) -> UInt8[Tensor, "4 size size"]:
        image = self.images[index % self.count]
        return image if index < self.count else image.flip(-1)


@dataclass(frozen=True)
class _Clouds:
    clouds: category_data.Numbered[Float[Tensor, "n 3"]]
    count: int
    signs: Float[Tensor, "3"]

    def __getitem__(self, index: int, /) -> Float[Tensor, "n 3"]:
        cloud = self.clouds[index % self.count]
        return cloud if index < self.count else cloud * self.signs


@dataclass(frozen=True)
class Samples:
    """Samples of `count` shapes and of their mirror images, which are `signs_of` the mirror times them."""

    samples: training_steps.SampleSource
    count: int
    signs: Float[Tensor, "3"]

    def draw(
        self,
        shapes: Int[np.ndarray, "b"],
        counts: Mapping[str, int],
        random: np.random.Generator,
        part: slice = slice(None),
    ) -> sample_batch.SampleBatch:
        """As `category_data.SampleSet.draw`."""
        batch = self.samples.draw(shapes % self.count, counts, random, part)
        turned = torch.from_numpy(shapes[part] >= self.count)[:, None, None]
        positions, directions, normals = (
            torch.where(turned, vectors * self.signs, vectors)
            for vectors in (batch.positions, batch.directions, batch.normals)
        )
        return replace(batch, positions=positions, directions=directions, normals=normals)


def of_images(images: category_data.ImageSet, mirror: cameras.Mirror | None) -> category_data.ImageSet:
    """The images, and behind them all of them flipped, of the mirrored shapes; as they are without a mirror."""
    if mirror is None:
        return images
    poses = torch.cat((images.cameras, cameras.mirrored(images.cameras, mirror)))
    shapes = np.concatenate((images.shapes, images.shapes + len(images.ids)))
    shown = _Images(images.images, len(images.shapes))
    return category_data.ImageSet([*images.ids] * 2, [*images.views] * 2, shapes, shown, poses)


def of_shapes(shapes: category_data.ShapeSet, mirror: cameras.Mirror | None) -> category_data.ShapeSet:
    """The shapes, and behind them their mirror images; as they are without a mirror."""
    if mirror is None:
        return shapes
    clouds = _Clouds(shapes.clouds, len(shapes.ids), signs_of(mirror))
    return category_data.ShapeSet([*shapes.ids] * 2, [*shapes.similarities] * 2, clouds)


def signs_of(mirror: cameras.Mirror) -> Float[Tensor, "3"]:
    """What a vector's coordinates are multiplied by."""
    return torch.tensor([-1.0 if axis == mirror else 1.0 for axis in "xyz"])
