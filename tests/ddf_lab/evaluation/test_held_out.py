"""Held-out shapes: encoded, and optimised."""

import _generative
import pytest
import torch
from _support import assert_close

from ddf_lab.evaluation.generative import held_out

SHAPES = _generative.shapes()


def test_optimised_latents_fit_better_and_leave_the_decoder_alone(tmp_path):
    model = _generative.vae()
    before = model.decoder.field.network.head.weight.clone()
    found = held_out.auto_decode(model, SHAPES, _generative.SCORES, tmp_path)
    assert found.shape == (3, 5) and float(found.abs().min(dim=1).values.max()) > 0
    assert_close(model.decoder.field.network.head.weight, before)
    again = held_out.auto_decode(_generative.vae(), SHAPES, _generative.SCORES, tmp_path / "again")
    assert torch.equal(found, again)
    with torch.no_grad():
        model.decoder.field.network.head.bias.add_(0.1)
    assert not torch.equal(found, held_out.auto_decode(model, SHAPES, _generative.SCORES, tmp_path))  # of another VAE
    rows = [row["loss"] for row in held_out.training_loop.read_log(tmp_path)]
    assert rows[-1] < rows[0]


def test_errors_name_every_sample_type():
    model = _generative.vae()
    mean, _ = held_out.encode(model, SHAPES, 0)
    found = held_out.errors(model, mean, SHAPES)
    assert list(found["depth_l1"]) == list("UABSTO") and min(found["visibility_bce"].values()) > 0


def test_summary_counts_the_dimensions_that_say_something():
    found = held_out.summary(torch.tensor([2.0, 0.5, 0.05]))
    assert found["used"] == 2 and found["sum"] == pytest.approx(2.55)
    by_dimension = held_out.divergences(_generative.vae(), SHAPES, 0)
    assert_close(by_dimension, by_dimension.sort(descending=True).values)
