"""The training and test images of one category with what belongs to them: cameras, masks, samples, clouds.

Everything is read from the artefacts of the stages `dataset` and `samples`; a batch is a function of (seed, step) alone.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import tqdm
from jaxtyping import Float, Int
from torch import Tensor

from ddf import cameras, checks, losses, packing, shapenet, storage, transforms


@dataclass(frozen=True)
class ImageSet:
    """Images of some shapes, kept as bytes.

    images: RGBA. cameras: azimuth and elevation in radians, radius in benchmark units. shapes: index into `ids`.
    """

    ids: Sequence[str]
    views: Sequence[int]
    shapes: Int[np.ndarray, "n"]
    images: Int[Tensor, "n 4 size size"]
    cameras: Float[Tensor, "n 3"]

    def batch(self, rows: Int[np.ndarray, "b"]) -> Float[Tensor, "b 4 size size"]:
        """Images in [0, 1]."""
        return self.images[torch.from_numpy(rows)].float() / 255

    def alpha(self, rows: Int[np.ndarray, "b"], size: int) -> Float[Tensor, "b size size"]:
        """Alpha channels in [0, 1], averaged down (never up) to size x size."""
        alpha = self.images[torch.from_numpy(rows), 3].float() / 255
        return torch.nn.functional.interpolate(alpha[:, None], (size, size), mode="area")[:, 0]


@dataclass(frozen=True)
class ShapeSet:
    """Field-from-v1 similarity, and ground-truth cloud in the field frame, of some shapes."""

    ids: Sequence[str]
    similarities: Sequence[transforms.Similarity]
    clouds: Sequence[Float[Tensor, "n 3"]]

    def field_scales(self, shapes: Int[np.ndarray, "b"]) -> Float[Tensor, "b"]:
        """Field units per v1 unit."""
        return torch.tensor([self.similarities[i].scale for i in shapes], dtype=torch.float32)

    def subset(self, shape: int, count: int, random: np.random.Generator) -> Float[Tensor, "count 3"]:
        """Random points of one cloud, without repetition as long as there are enough."""
        cloud = self.clouds[shape]
        return cloud[torch.from_numpy(random.choice(len(cloud), count, replace=len(cloud) < count))]


@dataclass(frozen=True)
class SampleSet:
    """Stored oriented-point samples of some shapes: `arrays["U.positions"]` is (shapes, n, 3), as `packing` says."""

    arrays: Mapping[str, Tensor]

    def draw(
        self, shapes: Int[np.ndarray, "b"], counts: Mapping[str, int], random: np.random.Generator
    ) -> losses.SampleBatch:
        """Random samples of every type for each of the given shapes, and `counts["E"]` uniform points without truth."""
        size, extra = len(shapes), counts["E"]
        position = random.uniform(-1, 1, (size, extra, 3)).astype(np.float32)
        direction = random.standard_normal((size, extra, 3)).astype(np.float32)
        direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
        unknown = torch.zeros(size, extra)
        parts = {
            "positions": [torch.from_numpy(position)],
            "directions": [torch.from_numpy(direction)],
            "visible": [unknown],
            "depth": [unknown],
            "normals": [unknown[..., None].expand(size, extra, 3)],
        }
        shape_rows = torch.from_numpy(shapes)[:, None]
        for kind in losses.SUPERVISED:
            stored = self.arrays[f"{kind}.depth"].shape[1]
            rows = torch.from_numpy(random.integers(0, stored, (size, counts[kind])))
            chosen = {f"{kind}.{name}": self.arrays[f"{kind}.{name}"][shape_rows, rows] for name in packing.FIELDS}
            samples = packing.decode(chosen, kind)
            visible = samples["visible"]
            parts["positions"].append(samples["positions"])
            parts["directions"].append(samples["directions"])
            parts["visible"].append(visible.float())
            parts["depth"].append(samples["depth"].masked_fill(~visible, 0.0))
            parts["normals"].append(samples["normals"])
        return losses.SampleBatch(**{name: torch.cat(values, dim=1) for name, values in parts.items()}, counts=counts)


def read_images(dataset: shapenet.Dataset, category: str, shapes: Sequence[tuple[str, Sequence[int]]], size: int) -> ImageSet:
    """Load the given (id, views) of one category at size x size.

    Raises:
      InputError: a file is missing, damaged or of another size; it is named.
    """
    images, poses, index, all_views = [], [], [], []
    for i, (shape_id, views) in enumerate(tqdm.tqdm(shapes, desc=f"images {category}", unit="shape", mininterval=2)):
        table = torch.tensor(dataset.cameras(category, shape_id), dtype=torch.float64)
        for view in views:
            image = dataset.image(category, shape_id, view, size)
            images.append((image * 255).round().to(torch.uint8))
            poses.append(cameras.degrees_to_radians(table[view]).float())
            index.append(i)
            all_views.append(view)
    if not images:
        raise checks.InputError(f"{dataset.root}: category {category} has no images for this split; use more shapes")
    return ImageSet([s for s, _ in shapes], all_views, np.array(index), torch.stack(images), torch.stack(poses))
