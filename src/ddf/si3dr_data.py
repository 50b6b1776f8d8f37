"""The training and test images of one category with what belongs to them: cameras, masks, samples, clouds.

Everything is read from the artefacts of the stages `dataset` and `samples`; a batch depends on (seed, step) alone.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import tqdm
from jaxtyping import Float, Int, UInt8
from torch import Tensor

from ddf import cameras, checks, losses, packing, shapenet, storage, transforms

SAMPLES, CLOUDS = ".samples.safetensors", ".clouds.safetensors"  # as the stage `samples` names them


@dataclass(frozen=True)
class ImageSet:
    """Images of some shapes, kept as bytes.

    images: RGBA. cameras: azimuth and elevation in radians, radius in benchmark units. shapes: index into `ids`.
    """

    ids: Sequence[str]
    views: Sequence[int]
    shapes: Int[np.ndarray, "n"]
    images: UInt8[Tensor, "n 4 size size"]
    cameras: Float[Tensor, "n 3"]

    def batch(self, rows: Int[np.ndarray, "b"]) -> Float[Tensor, "b 4 size size"]:
        """Images in [0, 1]."""
        return self.images[torch.from_numpy(rows)].float() / 255

    def names(self) -> list[dict[str, str | int]]:
        """Shape id and view of every image."""
        return [{"id": self.ids[int(i)], "view": view} for i, view in zip(self.shapes, self.views, strict=True)]

    def digest(self) -> str:
        """SHA-256 of images and cameras: a training goes on only with what it began with."""
        return hashlib.sha256(self.images.numpy().tobytes() + self.cameras.numpy().tobytes()).hexdigest()

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
        for wanted in losses.SUPERVISED:
            if not counts.get(wanted):
                continue
            kind = wanted.removesuffix("+")  # U+ are U samples, of which no derivative is read
            stored = self.arrays[f"{kind}.depth"].shape[1]
            rows = torch.from_numpy(random.integers(0, stored, (size, counts[wanted])))
            chosen = {f"{kind}.{name}": self.arrays[f"{kind}.{name}"][shape_rows, rows] for name in packing.FIELDS}
            samples = packing.decode(chosen, kind)
            visible = samples["visible"]
            parts["positions"].append(samples["positions"])
            parts["directions"].append(samples["directions"])
            parts["visible"].append(visible.float())
            parts["depth"].append(samples["depth"].masked_fill(~visible, 0.0))
            parts["normals"].append(samples["normals"])
        return losses.SampleBatch(**{name: torch.cat(values, dim=1) for name, values in parts.items()}, counts=counts)


def read_images(
    dataset: shapenet.Dataset, category: str, shapes: Sequence[tuple[str, Sequence[int]]], size: int
) -> ImageSet:
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


def training_views(dataset: shapenet.Dataset, category: str, count: int | None) -> list[tuple[str, Sequence[int]]]:
    """Training shapes with the views to show: those of the split, or the first `count`, never one of its test views."""
    if count is None:
        return list(dataset.train(category))
    shapes = [shape for shape in dataset.category(category).shapes if shape.train_views]
    return [(shape.id, [view for view in range(count) if view not in shape.test_views]) for shape in shapes]


def test_views(dataset: shapenet.Dataset, category: str, count: int | None) -> list[tuple[str, Sequence[int]]]:
    """Test shapes with the views to evaluate: those of the split, or the first `count` of them."""
    return [(name, views[:count]) for name, views in dataset.test(category)]


def available(folder: Path, shapes: Sequence[tuple[str, Sequence[int]]]) -> list[tuple[str, Sequence[int]]]:
    """Those of the split's shapes that came through watertighting and sampling (failures are in `failures.csv`)."""
    done = {
        name for path in storage.shard_files(folder, SAMPLES, "samples") for name in storage.load_metadata(path)["ids"]
    }
    return [(name, views) for name, views in shapes if name in done]


def read_training(
    index_path: Path, samples_dir: Path, category: str, views: int | None, size: int
) -> tuple[ImageSet, ShapeSet, list[Path]]:
    """What every training on a category reads: its images, their shapes, and the files that these came from.

    Args:
      views: of each training shape, see `training_views`.
      size: side of the images, pixels.
    Returns:
      Images, shapes and sources; of the images themselves a record takes `ImageSet.digest`.
    """
    dataset = shapenet.Dataset.open(index_path)
    shown = available(samples_dir, training_views(dataset, category, views))
    images = read_images(dataset, category, shown, size)
    shards = [path for kind in (SAMPLES, CLOUDS) for path in storage.shard_files(samples_dir, kind, "samples")]
    return images, read_shapes(samples_dir, images.ids), [index_path, *shards]


def read_shapes(folder: Path, ids: Sequence[str]) -> ShapeSet:
    """Similarities and ground-truth clouds of the given shapes, from the shards of stage `samples`.

    Raises:
      InputError: a shape is in no shard.
    """
    maps: dict[str, dict] = {}
    for path in storage.shard_files(folder, SAMPLES, "samples"):
        maps |= storage.load_metadata(path)["field_from_raw"]
    _require(folder, ids, maps)
    similarities = [transforms.Similarity.from_dict(maps[name]) for name in ids]
    clouds: dict[str, np.ndarray] = {}
    for path in storage.shard_files(folder, CLOUDS, "samples"):
        tensors, metadata = storage.load_tensors(path)
        for i, name in enumerate(metadata["ids"]):
            clouds[name] = tensors["points"][tensors["offsets"][i] : tensors["offsets"][i + 1]]
    placed = [frame.apply(clouds[name]) for name, frame in zip(ids, similarities, strict=True)]
    return ShapeSet(list(ids), similarities, [torch.from_numpy(points).float() for points in placed])


def read_samples(folder: Path, ids: Sequence[str]) -> SampleSet:
    """Stored samples of the given shapes, in their order, from the shards of stage `samples`.

    Raises:
      InputError: a shape is in no shard.
    """
    parts: dict[str, list[Tensor]] = {}
    row_of: dict[str, int] = {}
    wanted = set(ids)
    for path in storage.shard_files(folder, SAMPLES, "samples"):
        tensors, metadata = storage.load_tensors(path, framework="torch")
        rows = [i for i, name in enumerate(metadata["ids"]) if name in wanted]
        row_of |= {metadata["ids"][i]: len(row_of) + k for k, i in enumerate(rows)}
        for name, values in tensors.items():
            parts.setdefault(name, []).append(values[rows])
    _require(folder, ids, row_of)
    order = torch.tensor([row_of[name] for name in ids])
    return SampleSet({name: torch.cat(values)[order] for name, values in parts.items()})


def _require(folder: Path, ids: Sequence[str], found: Mapping) -> None:
    missing = [name for name in ids if name not in found]
    if missing:
        raise checks.InputError(f"{folder}: no samples of shape {missing[0]}; run the samples stage again")
