"""Training sets with mirror images: each is what casting, or looking, at the mirrored shape would have given."""

import dataclasses

import _models
import _shapes
import numpy as np
import pytest
import torch
from _support import assert_close

from ddf.data import mesh_preparation, sampling
from ddf.fields import losses
from ddf.geometry import cameras, mesh_io, raycast, rays, transforms
from ddf.reconstruction import (
    category_data,
    mirrored_data,
    proposed_rays,
    reconstruction_models,
    settings,
    training_steps,
    training_truth,
)

COUNTS = {"E": 3, "U": 20, "A": 20, "B": 20, "S": 4, "T": 4, "O": 4}
PROPOSALS = settings.ProposalConfig(30, 4, 0.5, 0.1, 0.05, 0.05)
MESHES = (  # neither is its own mirror image
    _shapes.moved(_shapes.icosphere(2, 0.3), np.array([1.0, 0.5, 1.5]), (0.3, -0.2, 0.4)),
    _shapes.moved(_shapes.cube(0.4), np.array([1.0, 1.5, 0.5]), (-0.4, 0.2, -0.3)),
)


def _mirrored_mesh(mesh, mirror):
    signs = mirrored_data.signs_of(mirror).double().numpy()
    return mesh_io.Mesh(mesh.vertices * signs, mesh.faces[:, ::-1].copy())


def _images():
    generator = torch.Generator().manual_seed(0)
    pixels = torch.randint(0, 256, (4, 4, 32, 32), generator=generator, dtype=torch.uint8)
    poses = torch.tensor([[0.2, 0.45, 0.7], [1.5, 0.5, 0.8], [3.0, 0.48, 0.75], [6.0, 0.47, 0.9]])
    return category_data.ImageSet(["a", "b"], [0, 1, 0, 1], np.array([0, 0, 1, 1]), pixels, poses)


def _shape_set():
    random = np.random.default_rng(0)
    clouds = [torch.from_numpy(mesh_preparation.Surface.of(mesh).draw(60, random)[0]).float() for mesh in MESHES]
    return category_data.ShapeSet(["a", "b"], [transforms.Similarity(1.0), transforms.Similarity(2.0)], clouds)


def _truth():
    scenes, drawn = [raycast.Scene(mesh) for mesh in MESHES], sampling.SamplesConfig()
    proposer = proposed_rays.Proposer(_shape_set(), scenes, PROPOSALS)
    return training_truth.Truth(training_truth.FreshSamples(scenes, drawn), proposer, drawn, [])


def _check(batch, row, mesh, first, last):
    known = batch.span(first, last)
    hits = raycast.cast(mesh, rays.OrientedPoints(batch.positions[row, known], batch.directions[row, known]))
    seen = hits.visible
    assert 0 < int(seen.sum()) < len(seen)
    assert torch.equal(batch.visible[row, known] == 1, seen)
    assert_close(batch.depth[row, known][seen].numpy(), hits.depth[seen].numpy(), atol=1e-4)
    return batch.normals[row, known][seen], hits.normals[seen]


@pytest.mark.parametrize("mirror", ["x", "z"])
def test_images_behind_the_others_are_flipped_and_have_mirrored_cameras_and_shapes(mirror):
    images = _images()
    both = mirrored_data.of_images(images, mirror)
    assert len(both.shapes) == 8 and len(both.ids) == 4
    assert torch.equal(both.batch(np.arange(4)), images.batch(np.arange(4)))
    assert torch.equal(both.batch(np.arange(4, 8)), images.batch(np.arange(4)).flip(-1))
    torch.testing.assert_close(both.alpha(np.array([6]), 16), images.alpha(np.array([2]), 16).flip(-1))
    assert torch.equal(both.cameras[4:], cameras.mirrored(images.cameras, mirror))
    assert both.shapes.tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    assert both.digest() != images.digest()


@pytest.mark.parametrize("mirror", ["x", "z"])
def test_samples_and_proposed_rays_are_those_of_the_mirrored_shape(mirror):
    shapes, chosen = _shape_set(), np.array([2, 0, 3])
    truth, random = _truth().mirrored(shapes, mirror), np.random.default_rng(0)
    batch, model = truth.samples.draw(chosen, COUNTS, random, slice(None)), _models.ddf_model()
    modulations = model.modulations(torch.zeros(3, _models.TRAIN.latent_features))
    assert truth.propose is not None
    batch = truth.propose(batch, model.field, modulations, chosen, random)
    for row, mesh in enumerate((_mirrored_mesh(MESHES[0], mirror), MESHES[0], _mirrored_mesh(MESHES[1], mirror))):
        own, hit = _check(batch, row, mesh, "U", "B")
        assert float((own * hit).sum(-1).min()) > 0.999
        _check(batch, row, mesh, "P", "P")
        starts = batch.positions[row, batch.span("S", "S")].double().numpy()
        assert raycast.Scene(mesh).distance(starts).max() < 1e-4


def test_a_part_of_a_batch_is_turned_as_in_the_whole():
    truth, chosen = _truth().mirrored(_shape_set(), "z"), np.array([2, 0, 3, 1])
    whole = truth.samples.draw(chosen, COUNTS, np.random.default_rng(0), slice(None))
    part = truth.samples.draw(chosen, COUNTS, np.random.default_rng(0), slice(1, 3))
    for name in ("positions", "directions", "normals", "depth"):
        assert torch.equal(getattr(part, name), getattr(whole, name)[1:3])


def test_clouds_are_mirrored_and_scales_stay():
    shapes = _shape_set()
    both = mirrored_data.of_shapes(shapes, "z")
    assert both.ids == ["a", "b", "a", "b"]
    assert torch.equal(both.field_scales(np.arange(4)), torch.tensor([1.0, 2.0, 1.0, 2.0]))
    assert torch.equal(both.clouds[1], shapes.clouds[1])
    assert torch.equal(both.clouds[3], shapes.clouds[1] * torch.tensor([1.0, 1.0, -1.0]))


def test_without_a_mirror_everything_stays_as_it_is():
    images, shapes, truth = _images(), _shape_set(), _truth()
    assert mirrored_data.of_images(images, None) is images
    assert mirrored_data.of_shapes(shapes, None) is shapes
    assert truth.mirrored(shapes, None) is truth


def test_both_models_train_on_the_doubled_set():
    train = _models.TRAIN
    images, shapes = mirrored_data.of_images(_images(), "z"), mirrored_data.of_shapes(_shape_set(), "z")
    truth = _truth().mirrored(_shape_set(), "z")
    ddf = dataclasses.replace(_models.DDF, proposals=PROPOSALS)
    model = reconstruction_models.ddf_model(train, ddf)
    model.camera_head.fit(images.cameras)
    loss, terms = training_steps.ddf_step(model, images, shapes, truth.samples, train, ddf, 0, truth.propose)
    loss.backward()
    assert torch.isfinite(loss) and set(losses.TERMS) <= set(terms)
    pcsiren = reconstruction_models.pcsiren_model(train, _models.PCSIREN)
    pcsiren.camera_head.fit(images.cameras)
    loss, _ = training_steps.pcsiren_step(pcsiren, images, shapes, train, _models.PCSIREN, 0)
    assert torch.isfinite(loss)
