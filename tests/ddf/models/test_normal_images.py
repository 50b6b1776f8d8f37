"""Normals rendered ahead."""

import dataclasses
import math

import _generative
import numpy as np
import torch
from _support import assert_close

from ddf.core import parallel, storage
from ddf.fields import model_files
from ddf.models import normal_images, pictures, shape_vae


def test_cameras_are_spread_evenly_over_their_part_of_the_sphere():
    random = np.random.default_rng(0)
    config = dataclasses.replace(_generative.NORMALS, elevation_deg=(0.0, 90.0))
    found = torch.stack([normal_images.random_camera(config, random) for _ in range(4000)])
    assert abs(float(found[:, 1].sin().mean()) - 0.5) < 0.02  # heights are uniform on a sphere
    assert abs(float(found[:, 0].mean()) - math.pi) < 0.1 and bool((found[:, 2] == 0.8).all())
    narrow = normal_images.random_camera(_generative.NORMALS, random)
    assert 25 <= math.degrees(float(narrow[1])) <= 30


def test_shards_hold_what_is_rendered(tmp_path):
    model = _generative.vae()
    record = {"kind": shape_vae.KIND, "vae": dataclasses.asdict(_generative.VAE)}
    storage.save_tensors(tmp_path / "vae" / model_files.MODEL, dict(model.state_dict()), record)
    out = tmp_path / "normals"

    def job(numbers, index):
        shard = parallel.Shard(out, index, "x")
        return normal_images.render_shard(_generative.NORMALS, tmp_path / "vae", numbers, shard)

    (path,) = job([2, 3], 1).files
    storage.write_json(out / "001.json", {"files": {path.name: ""}})
    found, files = normal_images.read(out)
    assert len(found) == 2 and files == [path]
    tensors, _ = storage.load_tensors(path, "torch")
    (field,) = pictures.fields(model.decoder, tensors["latents"][1:])
    normals, _ = normal_images.render(field, model.field_scale, tensors["cameras"][1])
    assert_close(found.batch(np.array([1]))[0], normals, atol=0.5 / normal_images.LEVELS + 1e-6)
    (again,) = job([3], 2).files  # an image depends on its number alone
    assert_close(storage.load_tensors(again, "torch")[0]["normals"][0], tensors["normals"][1])
    assert isinstance(job([0], 3), parallel.ShardResult)
