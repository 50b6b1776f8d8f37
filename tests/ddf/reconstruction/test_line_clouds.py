"""Clouds of the model with image features: reproducible, in order, by either camera, from one image and from three."""

import dataclasses

import _hand_made
import _models
import numpy as np
import torch
from _hand_made import POINTCLOUDS

from ddf.models import line_field
from ddf.reconstruction import line_clouds, three_views


def test_clouds_depend_on_the_camera_and_are_the_same_again():
    model, images = _hand_made.line_model(), _hand_made.images()
    tensors, facts = line_clouds.reconstruct(model, images, POINTCLOUDS)
    assert tensors["L.true"].shape == tensors["L.pred"].shape == (6, 60, 3)
    assert torch.equal(tensors["S.true"], tensors["L.true"][:, :30])
    assert not torch.equal(tensors["L.true"], tensors["L.pred"])
    assert bool((tensors["L.true"].abs() <= 1).all()) and set(facts["seconds"]) == {"encoders", "cloud"}
    assert bool((tensors["scale_true"] == 0.5).all()) and torch.equal(tensors["scale_true"], tensors["scale_pred"])
    again, _ = line_clouds.reconstruct(model, images, POINTCLOUDS)
    assert all(torch.equal(value, again[name]) for name, value in tensors.items())


def test_a_transparent_image_gives_a_point():
    model, images = _hand_made.line_model(), _hand_made.images()
    nothing = dataclasses.replace(images, images=torch.zeros(6, 4, 32, 32, dtype=torch.uint8))
    views = line_clouds.views_of(model, nothing, np.array([0]))
    cloud = line_clouds.draw(line_field.ImageField.of(model.decoder, views), 5, torch.Generator().manual_seed(0))
    assert torch.equal(cloud, torch.zeros(5, 3))


def test_three_views_of_one_image_are_that_image():
    images = _hand_made.images()
    rows = three_views.first_three(images)
    assert all(len(own) == 3 and len(set(images.shapes[own])) == 1 for own in rows.values())
    same = dataclasses.replace(images, shapes=np.zeros(6, dtype=int), images=images.images[:1].repeat(6, 1, 1, 1))
    same = dataclasses.replace(same, cameras=images.cameras[:1].repeat(6, 1))
    model = _hand_made.line_model()
    tensors, facts = three_views.of_features(model, same, POINTCLOUDS)
    alone, _ = line_clouds.reconstruct(model, same, POINTCLOUDS)
    assert facts == {three_views.CLOUDS: [same.ids[0]]}
    apart = (tensors[three_views.CLOUDS][0] - alone["L.true"][0] / line_field.FIELD_FROM_V1).norm(dim=-1)
    assert float((apart < 1e-6).float().mean()) > 0.9  # a tie may be taken either way


def test_latents_of_three_views_are_averaged_and_placed_as_the_truth():
    images, shapes = _hand_made.images(), _hand_made.shapes()
    images = dataclasses.replace(images, shapes=np.array([0, 0, 0, 1, 1, 1]))
    tensors, facts = three_views.of_latents(_models.ddf_model(), images, shapes, POINTCLOUDS)
    assert tensors[three_views.CLOUDS].shape == (2, 60, 3) and facts[three_views.CLOUDS] == list(images.ids[:2])
