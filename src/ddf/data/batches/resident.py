"""Training data in a GPU's memory: images as bytes, samples in their stored form, clouds.

What a step reads is then chosen and decoded on the GPU, from numbers that the host draws exactly as without one; they
are all that is sent. A kind of data that does not fit stays in its files, of which each step sends its part.
"""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import torch
import tqdm
from jaxtyping import Int
from torch import Tensor

from ddf.core import arrays, distributed
from ddf.data import packing
from ddf.data.batches import category_data
from ddf.data.samples import sample_types

LOGGER = logging.getLogger(__name__)
SHARE = 0.5  # of the memory that is free before the model is there; a step takes some of the rest


@dataclass(frozen=True)
class Samples(category_data.SampleSource):
    """Stored samples of some shapes in one tensor.

    records: see `packing`, all types one after the other. stored: samples of each type, in that order.
    """

    records: Int[Tensor, "shapes n record"]
    stored: Mapping[str, int]

    def __post_init__(self) -> None:
        object.__setattr__(self, "device", self.records.device)

    def stored_counts(self) -> Mapping[str, int]:
        """`stored`."""
        return self.stored

    def decoded(self, shapes: Int[np.ndarray, "b"], rows: Mapping[str, Int[np.ndarray, "b _"]]) -> packing.Samples:
        """As `category_data.SampleSource.decoded`, on the device of the records."""
        begins = dict(zip(self.stored, np.cumsum([0, *self.stored.values()]), strict=False))
        places = [begins[sample_types.base(name)] + own for name, own in rows.items()]
        index = shapes[:, None] * self.records.shape[1] + np.concatenate(places, axis=1)
        return packing.decode_fields(packing.parted(self.records.flatten(0, 1)[arrays.send(index, self.device)]))


def joined_samples(samples: category_data.SampleSet, device: torch.device) -> Samples:
    """All samples of a set on a device; one shard at a time is in the host's memory."""
    stored = samples.stored_counts()
    size = (len(samples.places), sum(stored.values()), packing.RECORD)
    whole = torch.zeros(size, dtype=torch.int16, device=device)
    by_shard = np.argsort([shard for shard, _ in samples.places], kind="stable")
    for shape in tqdm.tqdm(by_shard, desc="samples to the GPU", unit="shape", mininterval=2, disable=silent()):
        ((shard, row),) = samples.tables(np.array([shape]))
        own = {name: values[row] for name, values in shard.items()}
        whole[shape] = torch.from_numpy(np.concatenate([packing.records(own, kind) for kind in stored]))
    return Samples(whole, stored)


def joined_images(images: category_data.ImageSet, device: torch.device) -> category_data.ImageSet:
    """The same set, whose images and cameras are on a device."""
    whole = torch.zeros((len(images.shapes), *images.images[0].shape), dtype=torch.uint8, device=device)
    for row in range(len(whole)):
        whole[row] = images.images[row]
    return replace(images, images=whole, cameras=images.cameras.to(device))


def joined_clouds(shapes: category_data.ShapeSet, device: torch.device) -> category_data.ShapeSet:
    """The same set, whose clouds are on a device."""
    clouds = [shapes.clouds[index] for index in range(len(shapes.ids))]
    offsets = np.cumsum([0, *map(len, clouds)])
    return replace(shapes, clouds=category_data.JoinedClouds(torch.cat(clouds).to(device), offsets))


def room(device: torch.device) -> int:
    """Bytes that training data may take of a device's memory: `SHARE` of what is free; nothing of a CPU's."""
    return int(SHARE * torch.cuda.mem_get_info(device)[0]) if device.type == "cuda" else 0


class Memory:
    """What may still be taken of a device's memory, and what takes it: each kind of data that fits, when asked for."""

    def __init__(self, device: torch.device) -> None:
        self.device, self.left = device, room(device)

    def images(self, images: category_data.ImageSet) -> category_data.ImageSet:
        """The images, on the device if they fit there."""
        each = images.images[0].numel()
        return joined_images(images, self.device) if self.takes("images", len(images.shapes) * each) else images

    def clouds(self, shapes: category_data.ShapeSet) -> category_data.ShapeSet:
        """The shapes, with their clouds on the device if they fit there."""
        size = 12 * len(shapes.ids) * len(shapes.clouds[0])  # clouds differ by a tenth at most
        return joined_clouds(shapes, self.device) if self.takes("clouds", size) else shapes

    def samples(self, samples: category_data.SampleSet) -> category_data.SampleSource:
        """The samples, on the device if they fit there."""
        size = 2 * packing.RECORD * len(samples.places) * sum(samples.stored_counts().values())
        return joined_samples(samples, self.device) if self.takes("samples", size) else samples

    def takes(self, name: str, size: int, otherwise: str = "in files") -> bool:
        """Whether so many bytes are left, which then are taken; said in the log, with where the data are otherwise."""
        if self.device.type == "cpu":
            return False
        fits = size <= self.left
        self.left -= size if fits else 0
        where = f"in the memory of {self.device}" if fits else f"{otherwise}: the GPU has no room for them"
        LOGGER.info("%s of the training set, %.1f GiB: %s", name, size / 2**30, where)
        return fits


def silent() -> bool:
    """Whether another process shows the progress."""
    return distributed.rank() > 0
