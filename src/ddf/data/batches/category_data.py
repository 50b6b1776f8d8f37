"""The training and test images of one category with what belongs to them: cameras, masks, samples, clouds.

Everything is read from the artefacts of the stages `dataset` and `samples`; a batch depends on (seed, step) alone.
Images, samples and clouds are a tensor each, in a file without a name (`mapped`), so that memory does not grow with the
number of shapes, or in the memory of a GPU (`DeviceMemory`): what a step reads is chosen there and decoded there, from
numbers that the host draws, the same whatever the device.
"""

import hashlib
import logging
import os
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch
import tqdm
from jaxtyping import Float, Int, Int16, UInt8
from torch import Tensor

from ddf.core import arrays, checks, storage
from ddf.data import packing, shapenet
from ddf.data.public import manifest
from ddf.data.samples import sample_batch, sample_types
from ddf.geometry import cameras, transforms

LOGGER = logging.getLogger(__name__)
SAMPLES, CLOUDS = ".samples.safetensors", ".clouds.safetensors"  # as the stage `samples` names them
SHARE = 0.5  # of a GPU's memory that is free before the model is there; a step takes some of the rest

Shard = Mapping[str, np.ndarray]
Data = TypeVar("Data", "ImageSet", "ShapeSet", "SampleSet")


def mapped(shape: Sequence[int], dtype: Any) -> Tensor:
    """Zeros in a mapped file without a name, in the folder for temporary files (`TMPDIR`), which needs space for them;
    OSError names the folder where there is none.
    """
    with storage.naming(tempfile.gettempdir()), tempfile.TemporaryFile() as file:
        os.posix_fallocate(file.fileno(), 0, int(np.prod(shape)) * np.dtype(dtype).itemsize)
        return torch.from_numpy(np.memmap(file, dtype, "r+", shape=tuple(shape)))


@dataclass(frozen=True)
class ImageSet:
    """Images of some shapes, as bytes.

    images: RGBA. cameras: azimuth and elevation in radians, radius in benchmark units. shapes: index into `ids`.
    """

    ids: Sequence[str]
    views: Sequence[int]
    shapes: Int[np.ndarray, "n"]
    images: UInt8[Tensor, "n 4 size size"]
    cameras: Float[Tensor, "n 3"]

    def batch(self, rows: Int[np.ndarray, "b"]) -> Float[Tensor, "b 4 size size"]:
        """Images in [0, 1], where the images are."""
        return self.images[arrays.send(rows, self.images.device)].float() / 255

    def cameras_of(self, rows: Int[np.ndarray, "b"]) -> Float[Tensor, "b 3"]:
        """Where the cameras are."""
        return self.cameras[arrays.send(rows, self.cameras.device)]

    def names(self) -> list[dict[str, str | int]]:
        """Shape id and view of every image."""
        return [{"id": self.ids[int(i)], "view": view} for i, view in zip(self.shapes, self.views, strict=True)]

    def digest(self) -> str:
        """SHA-256 of images and cameras: a training goes on only with what it began with."""
        digest = hashlib.sha256()
        for image in self.images:
            digest.update(image.cpu().numpy().tobytes())
        digest.update(self.cameras.cpu().numpy().tobytes())
        return digest.hexdigest()

    def alpha(self, rows: Int[np.ndarray, "b"], size: int) -> Float[Tensor, "b size size"]:
        """Alpha channels in [0, 1], averaged down (never up) to size x size."""
        return averaged(self.batch(rows)[:, 3], size)


def averaged(alpha: Float[Tensor, "b side side"], size: int) -> Float[Tensor, "b size size"]:
    """Averaged down (never up) to size x size."""
    return torch.nn.functional.interpolate(alpha[:, None], (size, size), mode="area")[:, 0]


@dataclass(frozen=True)
class ShapeSet:
    """Field-from-v1 similarity, and ground-truth cloud in the field frame, of some shapes.

    points: of all clouds, one after the other. offsets: where each begins, and the end of the last.
    """

    ids: Sequence[str]
    similarities: Sequence[transforms.Similarity]
    points: Float[Tensor, "total 3"]
    offsets: Int[np.ndarray, "_"]

    @classmethod
    def of(
        cls,
        ids: Sequence[str],
        similarities: Sequence[transforms.Similarity],
        clouds: Sequence[Float[np.ndarray, "_ 3"]],
    ) -> "ShapeSet":
        """From clouds in v1."""
        offsets = np.cumsum([0, *map(len, clouds)])
        points = mapped((max(int(offsets[-1]), 1), 3), np.float32)
        for similarity, cloud, start in zip(similarities, clouds, offsets, strict=False):
            points[start : start + len(cloud)] = torch.from_numpy(similarity.apply(cloud)).float()
        return cls(list(ids), similarities, points, offsets)

    def cloud(self, shape: int) -> Float[Tensor, "n 3"]:
        """That of one shape."""
        return self.points[self.offsets[shape] : self.offsets[shape + 1]]

    def field_scales(self, shapes: Int[np.ndarray, "b"]) -> Float[Tensor, "b"]:
        """Field units per v1 unit."""
        return torch.tensor([self.similarities[i].scale for i in shapes], dtype=torch.float32)

    def field_shifts(self, shapes: Int[np.ndarray, "b"]) -> Float[Tensor, "b 3"]:
        """Where the origin of v1 lies in the field frame: 0 for shapes that are centred there, as v1's should be."""
        return torch.tensor(np.array([self.similarities[i].translation for i in shapes]), dtype=torch.float32)

    def placements(self, shapes: Int[np.ndarray, "b"]) -> dict[str, Tensor]:
        """The true map from the field to v1, `scale_true` (b,) and `centre_true` (b, 3): x_v1 = scale x + centre."""
        back = [self.similarities[i].inverse() for i in shapes]
        return {
            "scale_true": torch.tensor([each.scale for each in back], dtype=torch.float32),
            "centre_true": torch.tensor(np.array([each.translation for each in back]), dtype=torch.float32),
        }

    def subsets(
        self, shapes: Int[np.ndarray, "b"], count: int, random: np.random.Generator
    ) -> Float[Tensor, "b count 3"]:
        """Random points of the shapes' clouds, where the clouds are; without repetition as long as there are enough."""
        sizes = np.diff(self.offsets)
        rows = [self.offsets[i] + random.choice(sizes[i], count, replace=bool(sizes[i] < count)) for i in shapes]
        return self.points[arrays.send(np.stack(rows), self.points.device)]


@dataclass(frozen=True)
class SampleSet:
    """Stored oriented-point samples of some shapes.

    records: see `packing`, all types one after the other. stored: samples of each type, in that order.
    """

    records: Int16[Tensor, "shapes n record"]
    stored: Mapping[str, int]

    @classmethod
    def of(cls, shards: Sequence[Shard], places: Sequence[tuple[int, int]]) -> "SampleSet":
        """From shards, `shards[k]["U.positions"]` being (shapes, n, 3); places: shard and row in it of each shape."""
        stored = {kind: shards[0][f"{kind}.depth"].shape[1] for kind in sample_types.KINDS}
        records = mapped((len(places), sum(stored.values()), packing.RECORD), np.int16)
        for place, (shard, row) in enumerate(places):
            own = {name: values[row] for name, values in shards[shard].items()}
            records[place] = torch.from_numpy(np.concatenate([packing.records(own, kind) for kind in stored]))
        return cls(records, stored)

    def decoded(self, shapes: Int[np.ndarray, "b"], rows: Mapping[str, Int[np.ndarray, "b _"]]) -> packing.Samples:
        """Of each shape the samples of these rows of each name of a batch, one name after the other."""
        begins = dict(zip(self.stored, np.cumsum([0, *self.stored.values()]), strict=False))
        places = [begins[sample_types.base(name)] + own for name, own in rows.items()]
        index = shapes[:, None] * self.records.shape[1] + np.concatenate(places, axis=1)
        found = self.records.flatten(0, 1)[arrays.send(index, self.records.device)]
        return packing.decode_fields(packing.parted(found))

    def draw(
        self, shapes: Int[np.ndarray, "b"], counts: Mapping[str, int], random: np.random.Generator
    ) -> sample_batch.SampleBatch:
        """Random samples of every type for each of the given shapes, and `counts["E"]` uniform points without truth."""
        unknown = _without_truth(len(shapes), counts["E"], random, self.records.device)
        wanted = {name: counts[name] for name in sample_types.STORED if counts.get(name)}
        drawn = {
            name: random.integers(0, self.stored[sample_types.base(name)], (len(shapes), count))
            for name, count in wanted.items()
        }
        parts = [unknown, self.decoded(shapes, drawn)]
        columns = {name: torch.cat([each[name] for each in parts], dim=1) for name in packing.Samples.__annotations__}
        return sample_batch.SampleBatch(
            positions=columns["positions"],
            directions=columns["directions"],
            visible=columns["visible"].float(),
            depth=columns["depth"].masked_fill(~columns["visible"], 0.0),
            normals=columns["normals"],
            counts={"E": counts["E"], **wanted},
        )


def _without_truth(shapes: int, count: int, random: np.random.Generator, place: torch.device) -> packing.Samples:
    """Uniform oriented points of so many shapes, without ground truth."""
    position = random.uniform(-1, 1, (shapes, count, 3)).astype(np.float32)
    direction = random.standard_normal((shapes, count, 3)).astype(np.float32)
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    unknown = torch.zeros(position.shape[:2], device=place)
    positions, directions = arrays.send(position, place), arrays.send(direction, place)
    return packing.Samples(
        positions=positions,
        directions=directions,
        depth=unknown,
        visible=unknown.bool(),
        normals=torch.zeros_like(positions),
    )


class DeviceMemory:
    """What may still be taken of a device's memory, and what takes it: each kind of data that fits, when asked for."""

    def __init__(self, device: torch.device) -> None:
        self.device, self.left = device, room(device)

    def holds(self, name: str, data: Data) -> Data:
        """The data on the device if they fit there, else where they are, of which each step sends its part."""
        tensors = {each.name: value for each in fields(data) if isinstance(value := getattr(data, each.name), Tensor)}
        size = sum(value.nbytes for value in tensors.values())
        if self.device.type == "cpu":
            return data
        fits = size <= self.left
        where = f"in the memory of {self.device}" if fits else "in files: the GPU has no room for them"
        LOGGER.info("%s of the training set, %.1f GiB: %s", name, size / 2**30, where)
        if not fits:
            return data
        self.left -= size
        return replace(data, **{key: value.to(self.device) for key, value in tensors.items()})


def room(device: torch.device) -> int:
    """Bytes that training data may take of a device's memory: `SHARE` of what is free; nothing of a CPU's."""
    return int(SHARE * torch.cuda.mem_get_info(device)[0]) if device.type == "cuda" else 0


def read_images(
    dataset: shapenet.Dataset, category: str, shapes: Sequence[tuple[str, Sequence[int]]], size: int
) -> ImageSet:
    """Read the given (id, views) of one category at size x size."""
    index = np.repeat(np.arange(len(shapes)), [len(views) for _, views in shapes])
    if not len(index):
        raise checks.InputError(f"{dataset.root}: category {category} has no images for this split; use more shapes")
    images, poses, all_views = mapped((len(index), 4, size, size), np.uint8), [], []
    for shape_id, views in tqdm.tqdm(shapes, desc=f"images {category}", unit="shape", mininterval=2):
        table = torch.tensor(dataset.cameras(category, shape_id), dtype=torch.float64)
        for view in views:
            images[len(all_views)] = (dataset.image(category, shape_id, view, size) * 255).round().to(torch.uint8)
            all_views.append(view)
        poses.append(cameras.degrees_to_radians(table[list(views)]).float())
    return ImageSet([s for s, _ in shapes], all_views, index, images, torch.cat(poses))


def test_views(
    dataset: shapenet.Dataset, category: str, count: int | None, public: int | None = None, split: str = "test"
) -> list[tuple[str, Sequence[int]]]:
    """Test shapes (or those of another side) with the views to evaluate: those of the split, or the first `count` of
    them; of public and own ones the first `public`.
    """
    shapes = dataset.views(category, split)
    return [(name, views[: public if manifest.is_real(name) else count]) for name, views in shapes]


def available(folder: Path, shapes: Sequence[tuple[str, Sequence[int]]]) -> list[tuple[str, Sequence[int]]]:
    """Those of the split's shapes that came through watertighting and sampling (failures are in `failures.csv`)."""
    done = {
        name for path in storage.shard_files(folder, SAMPLES, "samples") for name in storage.load_metadata(path)["ids"]
    }
    return [(name, views) for name, views in shapes if name in done]


def read_training(
    index_path: Path, samples_dir: Path, category: str, size: int
) -> tuple[ImageSet, ShapeSet, list[Path]]:
    """What every training on a category reads: its images, their shapes, and the files that these came from; of the
    images themselves a record takes `ImageSet.digest`.
    """
    dataset = shapenet.Dataset.open(index_path)
    shown = available(samples_dir, dataset.views(category, "train"))
    images = read_images(dataset, category, shown, size)
    shards = [path for kind in (SAMPLES, CLOUDS) for path in storage.shard_files(samples_dir, kind, "samples")]
    return images, read_shapes(samples_dir, images.ids), [index_path, *shards]


def read_shapes(folder: Path, ids: Sequence[str]) -> ShapeSet:
    """Similarities and ground-truth clouds of the given shapes, from the shards of stage `samples`."""
    maps: dict[str, dict] = {}
    for path in storage.shard_files(folder, SAMPLES, "samples"):
        maps |= storage.load_metadata(path)["field_from_raw"]
    _require(folder, ids, maps)
    similarities = [transforms.Similarity.from_dict(maps[name]) for name in ids]
    shards, places = _find(folder, CLOUDS, ids)
    clouds = [packing.Cloud.stored(shards[shard], row).points for shard, row in places]
    return ShapeSet.of(ids, similarities, clouds)


def read_samples(folder: Path, ids: Sequence[str]) -> SampleSet:
    """Stored samples of the given shapes, in their order, from the shards of stage `samples`."""
    return SampleSet.of(*_find(folder, SAMPLES, ids))


def _find(folder: Path, kind: str, ids: Sequence[str]) -> tuple[list[Shard], list[tuple[int, int]]]:
    """The shards of one kind, verified and mapped, and the place of each of the given shapes: shard and row in it."""
    paths = storage.shard_files(folder, kind, "samples")
    places: dict[str, tuple[int, int]] = {}
    for number, path in enumerate(paths):
        _, metadata = storage.load_tensors(path, framework="torch")
        places |= {name: (number, row) for row, name in enumerate(metadata["ids"])}
    _require(folder, ids, places)
    return [storage.map_tensors(path) for path in paths], [places[name] for name in ids]


def _require(folder: Path, ids: Sequence[str], found: Mapping) -> None:
    missing = [name for name in ids if name not in found]
    if missing:
        raise checks.InputError(f"{folder}: no samples of shape {missing[0]}; run the samples stage again")
