"""Data in a device's memory gives the steps that files give, and only what has room goes there."""

import logging

import _hand_made
import numpy as np
import pytest
import torch
from _hand_made import COUNTS, DDF, PCSIREN, TRAIN

from ddf.data.batches import category_data, resident
from ddf.models import reconstruction_models
from ddf.training import reconstruction_steps

CPU = torch.device("cpu")


@pytest.fixture
def roomy(monkeypatch):
    """A device whose memory is as large as told, and is the CPU's."""

    def memory(left):
        monkeypatch.setattr(resident, "room", lambda device: left)
        found = resident.Memory(torch.device("cuda"))
        for name in ("joined_images", "joined_clouds", "joined_samples"):
            joined = getattr(resident, name)
            monkeypatch.setattr(resident, name, lambda data, _, joined=joined: joined(data, CPU))
        return found

    return memory


@pytest.mark.parametrize("part", [slice(None), slice(1, 3)])
def test_samples_in_memory_are_drawn_as_from_shards(part):
    stored, chosen = _hand_made.samples(), np.array([2, 0, 1, 2])
    held = resident.joined_samples(stored, CPU)
    assert held.records.dtype == torch.int16 and held.records.shape == (3, 6 * 40, 7)
    streams = [np.random.default_rng(3) for _ in range(2)]
    both = zip((stored, held), streams, strict=True)
    own, other = (source.draw(chosen, COUNTS, random, part) for source, random in both)
    assert own.counts == other.counts and streams[0].random() == streams[1].random()
    for one, two in zip(own.tensors(), other.tensors(), strict=True):
        assert torch.equal(one, two)


def test_images_and_clouds_in_memory_are_those_of_files():
    images, shapes = _hand_made.images(), _hand_made.shapes()
    file = category_data.ImageFile(32)
    for image in images.images:
        file.append(image.float() / 255)
    read = category_data.ImageSet(images.ids, images.views, images.shapes, file, images.cameras)
    held, joined = resident.joined_images(read, CPU), resident.joined_clouds(shapes, CPU)
    rows = np.array([4, 0, 4])
    assert isinstance(held.images, torch.Tensor) and held.images.dtype == torch.uint8
    assert torch.equal(held.batch(rows), read.batch(rows)) and held.digest() == read.digest()
    assert torch.equal(held.cameras_of(rows), read.cameras[rows])
    for count in (70, 90):  # of 80 points: without and with repetition
        found = [each.subsets(rows // 2, count, np.random.default_rng(2), slice(1, 3)) for each in (shapes, joined)]
        assert found[0].shape == (2, count, 3) and torch.equal(*found)
    assert torch.equal(joined.clouds[2], shapes.clouds[2])


@pytest.mark.parametrize("kind", ["ddf", "pcsiren"])
def test_steps_are_those_of_files_bit_for_bit(kind, roomy):
    def gradients(images, shapes, samples):
        torch.manual_seed(0)
        if kind == "ddf":
            model = reconstruction_models.DDFModel(TRAIN, DDF.field)
            model.camera_head.fit(images.cameras)
            loss, _ = reconstruction_steps.ddf_step(model, images, shapes, samples, TRAIN, DDF, 5)
        else:
            model = reconstruction_models.PCSirenModel(TRAIN)
            model.camera_head.fit(images.cameras)
            loss, _ = reconstruction_steps.pcsiren_step(model, images, shapes, TRAIN, PCSIREN, 5)
        loss.backward()
        return [loss.detach(), *(weight.grad for weight in model.parameters())]

    given = (_hand_made.images(), _hand_made.shapes(), _hand_made.samples())
    memory = roomy(1 << 30)
    held = (memory.images(given[0]), memory.clouds(given[1]), memory.samples(given[2]))
    assert all(type(own) is not type(other) for own, other in [(held[2], given[2]), (held[1].clouds, given[1].clouds)])
    for own, other in zip(gradients(*given), gradients(*held), strict=True):
        assert torch.equal(own, other)


def test_what_has_no_room_stays_in_its_files(roomy, caplog):
    images, shapes, samples = _hand_made.images(), _hand_made.shapes(), _hand_made.samples()
    sizes = {"images": 6 * 4 * 32 * 32, "clouds": 3 * 80 * 12, "samples": 3 * 6 * 40 * 14}
    memory = roomy(sizes["images"] + sizes["samples"] - 1)
    with caplog.at_level(logging.INFO):
        assert memory.images(images).images is not images.images
        assert memory.samples(samples) is samples and memory.left == sizes["samples"] - 1
        assert memory.clouds(shapes) is not shapes and memory.left == sizes["samples"] - 1 - sizes["clouds"]
    assert resident.Memory(CPU).images(images) is images  # a CPU keeps its files
    assert "samples of the training set" in caplog.text and "in files: the GPU has no room for them" in caplog.text
