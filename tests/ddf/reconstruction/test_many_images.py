"""Clouds, cameras and scales that small models reconstruct from hand-made images."""

import dataclasses

import _hand_made
import _models
import numpy as np
import pytest
import torch
from _hand_made import POINTCLOUDS, TRAIN

from ddf.core import checks
from ddf.fields import cloud_projection, rendering
from ddf.models import reconstruction_models, reconstruction_settings
from ddf.reconstruction import many_images, mask_descent


def test_scale_makes_the_box_diagonal_one():
    points = torch.tensor([[0.0, 0.0, 0.0], [1.0, 2.0, 2.0], [0.5, 1.0, 1.0]])
    assert mask_descent.scale_from_cloud(points) == pytest.approx(1 / 3)
    with pytest.raises(checks.InputError, match="one point"):
        mask_descent.scale_from_cloud(points[:1])


def test_reconstruction_has_the_promised_arrays():
    model, images = _models.ddf_model(), _hand_made.images()
    tensors, facts = many_images.reconstruct_ddf(model, images, POINTCLOUDS, "test")
    shapes = {name: tuple(values.shape) for name, values in tensors.items()}
    assert {k: v for k, v in shapes.items() if k[0] in "LS"} == {
        "L.h2": (6, 60, 3), "S.h2": (6, 30, 3), "L.h1": (6, 60, 3), "S.h1": (6, 30, 3)
    }  # fmt: skip
    assert shapes["camera_pred"] == shapes["camera_corrected"] == (6, 3)
    assert shapes["render.normals"] == (2, 12, 12, 3)
    assert facts["rendered"] == [0, 5]
    assert torch.equal(tensors["features"], reconstruction_models.image_stages(model, images)[-1])
    spans = (tensors["L.h2"].amax(1) - tensors["L.h2"].amin(1)).norm(dim=-1)
    torch.testing.assert_close(tensors["scale_pred"], 1 / spans)
    once = (tensors["L.h1"].amax(1) - tensors["L.h1"].amin(1)).norm(dim=-1)
    torch.testing.assert_close(tensors["scale_pred.h1"], 1 / once)
    assert not torch.equal(tensors["scale_pred.h1"], tensors["scale_pred"])
    assert set(facts["seconds"]) == {"encoders", "cloud", "camera_correction"} and min(facts["seconds"].values()) > 0


CORRECTED = dataclasses.replace(
    POINTCLOUDS, shape_correction=reconstruction_settings.ShapeCorrectionConfig(2, 0.1, 0.05, 0.0, 16)
)


def test_images_at_a_time_change_no_bit(monkeypatch):
    model, images, deviation = (_models.ddf_model("angle"), _hand_made.images(), torch.ones(TRAIN.latent_features))
    results = []
    for cores in (1, 3):
        usable = range(cores * torch.get_num_threads())
        monkeypatch.setattr(many_images.os, "sched_getaffinity", lambda _, usable=usable: usable, raising=False)
        monkeypatch.setattr(many_images, "CORRECTION_BATCH", {"cpu": 2})
        results.append(many_images.reconstruct_ddf(model, images, CORRECTED, "test", deviation)[0])
    for name, values in results[0].items():
        assert torch.equal(values, results[1][name]), name


def test_shapes_on_the_mask_have_clouds_and_scales_of_their_own_and_change_no_other():
    model, images = _models.ddf_model("angle"), _hand_made.images()
    deviation = mask_descent.latent_deviation(model, reconstruction_models.image_stages(model, images)[-1])
    plain, _ = many_images.reconstruct_ddf(model, images, POINTCLOUDS, "test")
    both, facts = many_images.reconstruct_ddf(model, images, CORRECTED, "test", deviation)
    assert both.keys() - plain.keys() == {"L.mask", "S.mask", "scale_pred.mask"}
    assert all(torch.equal(plain[name], both[name]) for name in plain)
    assert not torch.equal(both["L.mask"], both["L.h2"])
    spans = (both["L.mask"].amax(1) - both["L.mask"].amin(1)).norm(dim=-1)
    torch.testing.assert_close(both["scale_pred.mask"], 1 / spans)
    assert facts["seconds"]["shape_correction"] > 0
    with pytest.raises(ValueError, match="needs the deviation"):
        many_images.reconstruct_ddf(model, images, CORRECTED, "test")


def test_a_correction_starts_from_the_scale_that_a_small_cloud_tells(monkeypatch):
    model, images, seen = _models.ddf_model("angle"), _hand_made.images(), []
    correct = mask_descent.correct_shapes
    monkeypatch.setattr(mask_descent, "correct_shapes", lambda *given: seen.append(given[4]) or correct(*given))
    many_images.reconstruct_ddf(model, images, CORRECTED, "test", torch.ones(TRAIN.latent_features))
    rough = dataclasses.replace(POINTCLOUDS, large=many_images.ROUGH_POINTS)
    tensors, _ = many_images.reconstruct_ddf(model, images, rough, "test")
    torch.testing.assert_close(torch.cat(seen), 1 / tensors["scale_pred"])


def test_an_error_of_one_image_comes_through(monkeypatch):
    monkeypatch.setattr(cloud_projection, "select", lambda *_: pytest.fail("no cloud"))
    with pytest.raises(pytest.fail.Exception, match="no cloud"):
        many_images.reconstruct_ddf(_models.ddf_model("angle"), _hand_made.images(), POINTCLOUDS, "test")


def test_pcsiren_reconstruction_is_the_decoder_on_random_seeds():
    tensors, _ = many_images.reconstruct_pcsiren(_models.pcsiren_model(), _hand_made.images(), POINTCLOUDS)
    assert tuple(tensors["L"].shape) == (6, 60, 3)
    assert torch.equal(tensors["S"], tensors["L"][:, :30])
    assert not torch.equal(tensors["L"][0], tensors["L"][3])  # same shape, another image


def test_pcsirens_points_are_the_farthest_of_twice_as_many():
    model, images = _models.pcsiren_model(), _hand_made.images()
    farthest = dataclasses.replace(POINTCLOUDS, pcsiren_inputs="farthest")
    chosen = many_images.reconstruct_pcsiren(model, images, farthest)[0]
    twice = dataclasses.replace(POINTCLOUDS, large=120, pcsiren_inputs="even")
    mapped = many_images.reconstruct_pcsiren(model, images, twice)[0]["L"]
    assert torch.equal(chosen["S"], chosen["L"][:, :30])
    for cloud, candidates in zip(chosen["L"], mapped, strict=True):
        assert torch.equal(cloud[0], candidates[0])
        for count in (1, 30, 59):
            gaps = torch.cdist(candidates, cloud[:count]).amin(dim=1)
            torch.testing.assert_close(gaps.max(), torch.cdist(cloud[count][None], cloud[:count]).min())


def test_silhouettes_overlap_with_alpha():
    model, images = _models.ddf_model("angle"), _hand_made.images()
    tensors, _ = many_images.reconstruct_ddf(model, images, POINTCLOUDS, "test")
    _, latents, seen_from = reconstruction_models.encode(model, images)
    for row in (0, 4):
        given = images.batch(np.array([row]))[0, 3] > 0.5
        placed = ([m[row] for m in model.modulations(latents)], seen_from[row], 1 / tensors["scale_pred"][row])
        own = rendering.render(model.field, *placed, len(given))[0]["visibility"] > 0.5
        both, either = float((own * given).sum()), float(torch.maximum(own, given).sum())
        assert tensors["silhouette_iou"][row] == pytest.approx(both / max(either, 1))


def test_even_points_fill_the_cube_and_random_ones_are_the_plain_draw():
    drawn = many_images.cube_points(5, "random", torch.Generator().manual_seed(3))
    assert torch.equal(drawn, torch.rand((5, 3), generator=torch.Generator().manual_seed(3)) * 2 - 1)
    found = {}
    for how in ("random", "even"):
        points = many_images.cube_points(4096, how, torch.Generator().manual_seed(3))
        assert points.dtype == torch.float32 and float(points.abs().max()) <= 1
        for part in (points[:512], points):  # of S as of L
            cells = ((part + 1) * 4).long().clamp(0, 7)  # 512 of them
            counts = torch.bincount(cells @ torch.tensor([64, 8, 1]), minlength=512).double()
            found[how, len(part)] = float(counts.var()) / (len(part) / 512)  # 1 for independent points
    assert all(found["even", count] < 0.5 * found["random", count] for count in (512, 4096))
    first, second = (many_images.cube_points(9, "even", torch.Generator().manual_seed(i)) for i in (0, 1))
    assert not torch.equal(first, second)  # another image, another shift
