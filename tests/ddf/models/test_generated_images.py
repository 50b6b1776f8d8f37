"""Images of latents: rendered ahead, with each texture, and on the way from one latent to another."""

import dataclasses
import math

import _generative
import numpy as np
import torch
from _support import assert_close

from ddf.core import parallel, storage
from ddf.fields import model_files
from ddf.models import generated_images, generative_models


def test_cameras_are_spread_evenly_over_their_part_of_the_sphere():
    random = np.random.default_rng(0)
    config = dataclasses.replace(_generative.NORMALS, elevation_deg=(0.0, 90.0))
    found = torch.stack([generated_images.random_camera(config, random) for _ in range(4000)])
    assert abs(float(found[:, 1].sin().mean()) - 0.5) < 0.02  # heights are uniform on a sphere
    assert abs(float(found[:, 0].mean()) - math.pi) < 0.1 and bool((found[:, 2] == 0.8).all())
    narrow = generated_images.random_camera(_generative.NORMALS, random)
    assert 25 <= math.degrees(float(narrow[1])) <= 30


def test_shards_hold_what_is_rendered(tmp_path):
    model = _generative.vae()
    model.field_scale.fill_(2.25)
    record = {"kind": generative_models.VAE, "vae": dataclasses.asdict(_generative.VAE)}
    storage.save_tensors(tmp_path / "vae" / model_files.MODEL, dict(model.state_dict()), record)
    out = tmp_path / "normals"

    def job(numbers, index):
        shard = parallel.Shard(out, index, "x")
        return generated_images.render_shard(_generative.NORMALS, tmp_path / "vae", numbers, shard)

    (path,) = job([2, 3], 1).files
    storage.write_json(out / "001.json", {"files": {path.name: ""}})
    found, files = generated_images.read_normals(out)
    assert len(found) == 2 and files == [path]
    tensors, _ = storage.load_tensors(path, "torch")
    (field,) = generated_images.fields(model.decoder, tensors["latents"][1:])
    normals, _ = generated_images.render(field, model.field_scale, tensors["cameras"][1])
    assert_close(found[1].float() / generated_images.LEVELS, normals, atol=0.5 / generated_images.LEVELS + 1e-6)
    (again,) = job([3], 2).files  # an image depends on its number alone
    assert_close(storage.load_tensors(again, "torch")[0]["normals"][0], tensors["normals"][1])
    assert isinstance(job([0], 3), parallel.ShardResult)


def test_latents_between_two_keep_their_lengths():
    first, last = torch.tensor([3.0, 0.0, 0.0]), torch.tensor([0.0, 1.0, 0.0])
    found = generated_images.between((first, last), 3)
    assert_close(found[[0, 2]], torch.stack((first, last)))
    assert_close(found[1], torch.tensor([2**0.5, 2**0.5, 0.0]))
    assert_close(generated_images.between((first, first), 3), first.expand(3, 3))


def test_a_shape_is_seen_with_each_texture():
    model = _generative.image_gan().eval()
    (field,) = generated_images.fields(model.decoder, torch.ones(1, 5))
    (camera,) = generated_images.cameras_around(1, 30.0, 0.8)
    seen = generated_images.look(model, field, camera, torch.eye(3)[:2])
    assert seen.colours.shape == (2, 3, 64, 64) and float(seen.colours.min()) >= 0 and float(seen.colours.max()) <= 1
    hidden = ~seen.depth.isfinite()
    assert float(seen.normals[:, hidden].abs().sum()) == 0
    assert_close(seen.normals[:, ~hidden].norm(dim=0), torch.ones(int((~hidden).sum())))
    white = generated_images.on_white(seen.normals)
    assert bool((white[:, hidden] == 1).all())
