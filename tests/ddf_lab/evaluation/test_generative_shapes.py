"""Shapes that a VAE did not learn, encoded and optimised; clouds of its fields: distances to the nearest, frames."""

import _generative
import numpy as np
import pytest
import torch
from _support import assert_close

from ddf.geometry import neighbours
from ddf.models import generated_images
from ddf_lab.evaluation import generative_shapes

SHAPES = _generative.shapes()


def test_optimised_latents_fit_better_and_leave_the_decoder_alone(tmp_path):
    model = _generative.vae()
    before = model.decoder.field.network.head.weight.clone()
    found = generative_shapes.auto_decode(model, SHAPES, _generative.SCORES, tmp_path)
    assert found.shape == (3, 5) and float(found.abs().min(dim=1).values.max()) > 0
    assert_close(model.decoder.field.network.head.weight, before)
    again = generative_shapes.auto_decode(_generative.vae(), SHAPES, _generative.SCORES, tmp_path / "again")
    assert torch.equal(found, again)
    with torch.no_grad():
        model.decoder.field.network.head.bias.add_(0.1)
    other = generative_shapes.auto_decode(model, SHAPES, _generative.SCORES, tmp_path)
    assert not torch.equal(found, other)  # of another VAE
    rows = [row["loss"] for row in generative_shapes.training_loop.read_log(tmp_path)]
    assert rows[-1] < rows[0]


def test_the_divergence_is_that_of_all_dimensions_of_which_some_are_used():
    model = _generative.vae()
    found = generative_shapes.divergence(model, SHAPES, 0)
    by_dimension = generative_shapes.generative_models.divergence(*generative_shapes.encode(model, SHAPES, 0)).mean(0)
    assert found["sum"] == pytest.approx(float(by_dimension.sum())) and found["dimensions"] == len(by_dimension) == 5
    assert found["used"] == sum(value > 0.1 for value in by_dimension.tolist())


def _cloud(x):
    return neighbours.Neighbours(np.array([[x, 0.0, 0.0], [x, 1.0, 0.0]]), "cloud")


def test_the_nearest_is_found():
    learned = [_cloud(x) for x in (0.0, 0.1, 0.5)]
    assert generative_shapes.nearest([_cloud(0.45), _cloud(0.11)], learned) == [2, 1]


def test_sets_are_compared_by_their_nearest():
    truth = [_cloud(x) for x in (0.0, 1.0, 2.0, 3.0)]
    one_place = generative_shapes.distribution([_cloud(x) for x in (0.1, 0.11, 0.12, 0.13)], truth)
    assert one_place["matching_x1000"] == pytest.approx(1000 * 2 * (0.1**2 + 0.87**2 + 1.87**2 + 2.87**2) / 4, rel=0.01)
    assert one_place["coverage"] == 0.25
    assert one_place["told_apart"] == 0.75  # the true ones at 0 and 1 are nearest to made ones
    same = generative_shapes.distribution([_cloud(x + 0.1) for x in (0.0, 1.0, 2.0, 3.0)], truth)
    assert same["coverage"] == 1 and same["matching_x1000"] == pytest.approx(20.0)
    assert same["told_apart"] == 0  # each is beside one of the other set


def test_energy_ranks_the_mean_shape_blur_and_noise_behind_samples():
    truth, made = (np.random.default_rng(seed).normal(size=24) for seed in (0, 1))
    noise = np.random.default_rng(2).normal(size=(24, 2, 3))
    sets = {
        "samples": [_cloud(x) for x in made],
        "mean": [_cloud(0.0)] * 24,
        "blur": [_cloud(0.3 * x) for x in made],
        "noise": [neighbours.Neighbours(_cloud(x).points + each) for x, each in zip(made, noise, strict=True)],
    }
    known = [_cloud(x) for x in truth]
    found = {name: generative_shapes.distribution(clouds, known)["energy_x1000"] for name, clouds in sets.items()}
    assert min(found, key=lambda name: found[name]) == "samples"
    assert min(found[name] for name in ("mean", "blur", "noise")) > 2 * found["samples"]
    assert generative_shapes.distribution(known, known)["energy_x1000"] == pytest.approx(0, abs=1e-9)


def test_clouds_of_fields_are_in_the_benchmark_frame():
    fields = generated_images.fields(_generative.vae().decoder, torch.ones(1, 5))
    (near,) = generative_shapes.of_fields(fields, [2.0], 20, 0)
    (far,) = generative_shapes.of_fields(fields, [1.0], 20, 0)
    assert len(near) == 20
    assert generative_shapes.compared([near], [near])["chamfer_l2_sq_x1000"] == 0
    assert float(far.spacing().mean()) == pytest.approx(2 * float(near.spacing().mean()))
