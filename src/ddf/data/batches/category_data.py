"""The training and test images of one category with what belongs to them: cameras, masks, samples, clouds.

Everything is read from the artefacts of the stages `dataset` and `samples`; a batch depends on (seed, step) alone.
Memory does not grow with the number of shapes: samples and clouds stay in their shards, which are mapped a few at a
time, and images are kept in a temporary file.
"""

import abc
import functools
import hashlib
import math
import os
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np
import torch
import tqdm
from jaxtyping import Float, Int, Shaped, UInt8
from torch import Tensor

from ddf.core import arrays, checks, distributed, storage
from ddf.data import packing, shapenet
from ddf.data.public import manifest
from ddf.data.samples import sample_batch, sample_types
from ddf.geometry import cameras, transforms

SAMPLES, CLOUDS = ".samples.safetensors", ".clouds.safetensors"  # as the stage `samples` names them
OPEN_SHARDS = 8  # of each kind, whatever the number of shapes; to open one more takes a millisecond

Shard = Mapping[str, np.ndarray]
Value = TypeVar("Value", covariant=True)


@runtime_checkable
class Numbered(Protocol[Value]):
    """What is asked for by its number: a list, or something that reads it then."""

    def __getitem__(self, index: int, /) -> Value: ...


class ImageFile:
    """Images of one size in a file without a name, in the folder for temporary files (`TMPDIR`), which needs space for
    them: 4 size^2 bytes each.
    """

    def __init__(self, size: int) -> None:
        self._shape = (4, size, size)
        self._file = tempfile.TemporaryFile()
        weakref.finalize(self, self._file.close)

    def append(self, image: Float[Tensor, "4 size size"]) -> None:
        """Add an image in [0, 1], rounded to bytes."""
        with storage.naming(tempfile.gettempdir()):
            self._file.write((image * 255).round().to(torch.uint8).numpy().tobytes())
            self._file.flush()

    def __getitem__(self, index: int, /) -> UInt8[Tensor, "4 size size"]:
        length = math.prod(self._shape)
        data = os.pread(self._file.fileno(), length, index * length)
        return torch.frombuffer(bytearray(data), dtype=torch.uint8).reshape(self._shape)


@dataclass(frozen=True)
class ImageSet:
    """Images of some shapes, as bytes.

    images: RGBA. cameras: azimuth and elevation in radians, radius in benchmark units. shapes: index into `ids`.
    """

    ids: Sequence[str]
    views: Sequence[int]
    shapes: Int[np.ndarray, "n"]
    images: Numbered[UInt8[Tensor, "4 size size"]]
    cameras: Float[Tensor, "n 3"]

    def batch(self, rows: Int[np.ndarray, "b"]) -> Float[Tensor, "b 4 size size"]:
        """Images in [0, 1], where the images are."""
        if isinstance(self.images, Tensor):
            return self.images[arrays.send(rows, self.images.device)].float() / 255
        return torch.stack([self.images[int(row)] for row in rows]).float() / 255

    def cameras_of(self, rows: Int[np.ndarray, "b"]) -> Float[Tensor, "b 3"]:
        """Where the cameras are."""
        return self.cameras[arrays.send(rows, self.cameras.device)]

    def names(self) -> list[dict[str, str | int]]:
        """Shape id and view of every image."""
        return [{"id": self.ids[int(i)], "view": view} for i, view in zip(self.shapes, self.views, strict=True)]

    def digest(self) -> str:
        """SHA-256 of images and cameras: a training goes on only with what it began with."""
        digest = hashlib.sha256()
        for row in range(len(self.shapes)):
            digest.update(self.images[row].cpu().numpy().tobytes())
        digest.update(self.cameras.cpu().numpy().tobytes())
        return digest.hexdigest()

    def alpha(self, rows: Int[np.ndarray, "b"], size: int) -> Float[Tensor, "b size size"]:
        """Alpha channels in [0, 1], averaged down (never up) to size x size."""
        return averaged(self.batch(rows)[:, 3], size)


def averaged(alpha: Float[Tensor, "b side side"], size: int) -> Float[Tensor, "b size size"]:
    """Averaged down (never up) to size x size."""
    return torch.nn.functional.interpolate(alpha[:, None], (size, size), mode="area")[:, 0]


class MappedShards:
    """Arrays of safetensors files whose checksums have been verified, mapped when they are asked for."""

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = list(paths)
        self._open = functools.lru_cache(maxsize=OPEN_SHARDS)(storage.map_tensors)

    def __getitem__(self, index: int, /) -> Shard:
        return self._open(self._paths[index])


@dataclass(frozen=True)
class PlacedClouds:
    """Ground-truth clouds in the field frame, each read and placed when it is asked for.

    places: shard and row in it of each shape. similarities: field from v1.
    """

    shards: Numbered[Shard]
    places: Sequence[tuple[int, int]]
    similarities: Sequence[transforms.Similarity]

    def __getitem__(self, index: int, /) -> Float[Tensor, "n 3"]:
        number, row = self.places[index]
        cloud = packing.Cloud.stored(self.shards[number], row)
        return torch.from_numpy(self.similarities[index].apply(cloud.points)).float()


@dataclass(frozen=True)
class ShapeSet:
    """Field-from-v1 similarity, and ground-truth cloud in the field frame, of some shapes."""

    ids: Sequence[str]
    similarities: Sequence[transforms.Similarity]
    clouds: Numbered[Float[Tensor, "n 3"]]

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

    def subset(self, shape: int, count: int, random: np.random.Generator) -> Float[Tensor, "count 3"]:
        """Random points of one cloud, without repetition as long as there are enough."""
        cloud = self.clouds[shape]
        return cloud[torch.from_numpy(subset_rows(len(cloud), count, random))]

    def subsets(
        self, shapes: Int[np.ndarray, "b"], count: int, random: np.random.Generator, part: slice = slice(None)
    ) -> Float[Tensor, "own count 3"]:
        """`subset` of `part` of the shapes, drawn for all of them, where the clouds are."""
        if isinstance(self.clouds, JoinedClouds):
            return self.clouds.subsets(shapes, count, random, part)
        return torch.stack([self.subset(int(shape), count, random) for shape in shapes][part])


def subset_rows(size: int, count: int, random: np.random.Generator) -> Int[np.ndarray, "count"]:
    """Which points of a cloud of this size a subset has."""
    return random.choice(size, count, replace=size < count)


@dataclass(frozen=True)
class JoinedClouds:
    """Clouds of the field frame in one tensor, on any device. offsets: where each begins, and the end of the last."""

    points: Float[Tensor, "total 3"]
    offsets: Int[np.ndarray, "_"]

    def __getitem__(self, index: int, /) -> Float[Tensor, "n 3"]:
        return self.points[self.offsets[index] : self.offsets[index + 1]]

    def subsets(
        self, shapes: Int[np.ndarray, "b"], count: int, random: np.random.Generator, part: slice
    ) -> Float[Tensor, "own count 3"]:
        """As `ShapeSet.subsets`."""
        sizes = np.diff(self.offsets)
        rows = [self.offsets[shape] + subset_rows(int(sizes[shape]), count, random) for shape in shapes]
        return self.points[arrays.send(np.stack(rows)[part], self.points.device)]


class SampleSource(abc.ABC):
    """Gives the oriented points of a batch with their ground truth."""

    device = torch.device("cpu")  # where the points are

    @abc.abstractmethod
    def stored_counts(self) -> Mapping[str, int]:
        """How many samples of each type a shape has, the same for all."""

    @abc.abstractmethod
    def decoded(self, shapes: Int[np.ndarray, "b"], rows: Mapping[str, Int[np.ndarray, "b _"]]) -> packing.Samples:
        """Of each shape the samples of these rows of each name of a batch, one name after the other."""

    def draw(
        self,
        shapes: Int[np.ndarray, "b"],
        counts: Mapping[str, int],
        random: np.random.Generator,
        part: slice = slice(None),
    ) -> sample_batch.SampleBatch:
        """Random samples of every type for each of the given shapes, and `counts["E"]` uniform points without truth.

        Args:
          part: keep these of the shapes alone, with the samples that they have among all.
        """
        unknown, stored = _without_truth(len(shapes), counts["E"], random, part, self.device), self.stored_counts()
        wanted = {name: counts[name] for name in sample_types.STORED if counts.get(name)}
        drawn = {
            name: random.integers(0, stored[sample_types.base(name)], (len(shapes), count))[part]
            for name, count in wanted.items()
        }
        parts = [unknown, self.decoded(shapes[part], drawn)]
        columns = {name: torch.cat([each[name] for each in parts], dim=1) for name in packing.Samples.__annotations__}
        return sample_batch.SampleBatch(
            positions=columns["positions"],
            directions=columns["directions"],
            visible=columns["visible"].float(),
            depth=columns["depth"].masked_fill(~columns["visible"], 0.0),
            normals=columns["normals"],
            counts={"E": counts["E"], **wanted},
        )


@dataclass(frozen=True)
class SampleSet(SampleSource):
    """Stored oriented-point samples of some shapes, as `packing` says.

    shards: `shards[k]["U.positions"]` is (shapes, n, 3). places: shard and row in it of each shape.
    """

    shards: Numbered[Shard]
    places: Sequence[tuple[int, int]]

    def stored_counts(self) -> dict[str, int]:
        """Those of the first shape."""
        ((shard, _),) = self.tables(np.array([0]))
        return {kind: shard[f"{kind}.depth"].shape[1] for kind in sample_types.KINDS}

    def decoded(self, shapes: Int[np.ndarray, "b"], rows: Mapping[str, Int[np.ndarray, "b _"]]) -> packing.Samples:
        """As `SampleSource.decoded`; each shard is opened once."""
        tables = self.tables(shapes)
        codes = {
            field: [gather(tables, f"{sample_types.base(name)}.{field}", own) for name, own in rows.items()]
            for field in packing.FIELDS
        }
        return packing.decode_fields({field: torch.cat(parts, dim=1) for field, parts in codes.items()})

    def tables(self, shapes: Int[np.ndarray, "b"]) -> list[tuple[Shard, int]]:
        """The shard of each shape and its row there, for `gather`; each shard is opened once."""
        places = [self.places[i] for i in shapes]
        opened = {number: self.shards[number] for number in {number for number, _ in places}}
        return [(opened[number], row) for number, row in places]


def _without_truth(
    shapes: int, count: int, random: np.random.Generator, part: slice, place: torch.device
) -> packing.Samples:
    """Uniform oriented points of so many shapes, without ground truth; those of the shapes `part` are kept."""
    position = random.uniform(-1, 1, (shapes, count, 3))[part].astype(np.float32)
    direction = random.standard_normal((shapes, count, 3))[part].astype(np.float32)
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


def gather(tables: Sequence[tuple[Shard, int]], name: str, rows: Int[np.ndarray, "b n"]) -> Shaped[Tensor, "b n *rest"]:
    """Rows `rows[k]` of the array `name` of the k-th shape, which is row `tables[k][1]` of its shard."""
    parts = [shard[name][shape].take(own, axis=0) for (shard, shape), own in zip(tables, rows, strict=True)]
    return torch.from_numpy(np.stack(parts))


def read_images(
    dataset: shapenet.Dataset, category: str, shapes: Sequence[tuple[str, Sequence[int]]], size: int
) -> ImageSet:
    """Read the given (id, views) of one category at size x size.

    Raises:
      InputError: a file is missing, damaged or of another size; it is named.
    """
    images, poses, index, all_views = ImageFile(size), [], [], []
    others = distributed.rank() > 0  # show no progress
    progress = tqdm.tqdm(shapes, desc=f"images {category}", unit="shape", mininterval=2, disable=others)
    for i, (shape_id, views) in enumerate(progress):
        table = torch.tensor(dataset.cameras(category, shape_id), dtype=torch.float64)
        for view in views:
            images.append(dataset.image(category, shape_id, view, size))
            index.append(i)
            all_views.append(view)
        poses.append(cameras.degrees_to_radians(table[list(views)]).float())
    if not index:
        raise checks.InputError(f"{dataset.root}: category {category} has no images for this split; use more shapes")
    return ImageSet([s for s, _ in shapes], all_views, np.array(index), images, torch.cat(poses))


def test_views(
    dataset: shapenet.Dataset, category: str, count: int | None, public: int | None = None, split: str = "test"
) -> list[tuple[str, Sequence[int]]]:
    """Test shapes (or those of another side) with the views to evaluate: those of the split, or the first `count` of
    them; of public and own ones the first `public`.
    """
    shapes = getattr(dataset, split)(category)
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
    """What every training on a category reads: its images, their shapes, and the files that these came from.

    Args:
      size: side of the images, pixels.
    Returns:
      Images, shapes and sources; of the images themselves a record takes `ImageSet.digest`.
    """
    dataset = shapenet.Dataset.open(index_path)
    shown = available(samples_dir, dataset.train(category))
    images = read_images(dataset, category, shown, size)
    shards = [path for kind in (SAMPLES, CLOUDS) for path in storage.shard_files(samples_dir, kind, "samples")]
    return images, read_shapes(samples_dir, images.ids), [index_path, *shards]


def read_shapes(folder: Path, ids: Sequence[str]) -> ShapeSet:
    """Similarities and ground-truth clouds of the given shapes, from the shards of stage `samples`.

    Raises:
      InputError: a shape is in no shard, or a shard is damaged; it is named.
    """
    maps: dict[str, dict] = {}
    for path in storage.shard_files(folder, SAMPLES, "samples"):
        maps |= storage.load_metadata(path)["field_from_raw"]
    _require(folder, ids, maps)
    similarities = [transforms.Similarity.from_dict(maps[name]) for name in ids]
    return ShapeSet(list(ids), similarities, PlacedClouds(*_find(folder, CLOUDS, ids), similarities))


def read_samples(folder: Path, ids: Sequence[str]) -> SampleSet:
    """Stored samples of the given shapes, in their order, from the shards of stage `samples`.

    Raises:
      InputError: a shape is in no shard, or a shard is damaged; it is named.
    """
    return SampleSet(*_find(folder, SAMPLES, ids))


def _find(folder: Path, kind: str, ids: Sequence[str]) -> tuple[MappedShards, list[tuple[int, int]]]:
    """The shards of one kind, each verified, and the place of each of the given shapes: shard and row in it."""
    paths = storage.shard_files(folder, kind, "samples")
    places: dict[str, tuple[int, int]] = {}
    for number, path in enumerate(paths):
        _, metadata = storage.load_tensors(path, framework="torch")
        places |= {name: (number, row) for row, name in enumerate(metadata["ids"])}
    _require(folder, ids, places)
    return MappedShards(paths), [places[name] for name in ids]


def _require(folder: Path, ids: Sequence[str], found: Mapping) -> None:
    missing = [name for name in ids if name not in found]
    if missing:
        raise checks.InputError(f"{folder}: no samples of shape {missing[0]}; run the samples stage again")
