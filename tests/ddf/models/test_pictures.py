"""What a latent looks like, and the way from one to another."""

import _generative
import torch
from _support import assert_close

from ddf.models import pictures


def test_latents_between_two_keep_their_lengths():
    first, last = torch.tensor([3.0, 0.0, 0.0]), torch.tensor([0.0, 1.0, 0.0])
    found = pictures.between((first, last), 3)
    assert_close(found[[0, 2]], torch.stack((first, last)))
    assert_close(found[1], torch.tensor([2**0.5, 2**0.5, 0.0]))
    assert_close(pictures.between((first, first), 3), first.expand(3, 3))


def test_a_shape_is_seen_with_each_texture():
    model = _generative.image_gan().eval()
    (field,) = pictures.fields(model.decoder, torch.ones(1, 5))
    (camera,) = pictures.cameras_around(1, 30.0, 0.8)
    seen = pictures.look(model, field, camera, torch.eye(3)[:2])
    assert seen.colours.shape == (2, 3, 64, 64) and float(seen.colours.min()) >= 0 and float(seen.colours.max()) <= 1
    hidden = ~seen.depth.isfinite()
    assert float(seen.normals[:, hidden].abs().sum()) == 0
    assert_close(seen.normals[:, ~hidden].norm(dim=0), torch.ones(int((~hidden).sum())))
    white = pictures.on_white(seen.normals)
    assert bool((white[:, hidden] == 1).all())


def test_cameras_stand_all_round():
    turns = torch.stack(pictures.cameras_around(4, 30.0, 0.8))
    assert_close(turns[1:, 0] - turns[:-1, 0], torch.full((3,), torch.pi / 2))
