"""The shape VAE: its size, and its samples as plain fields."""

import dataclasses

import _generative
import _models
import numpy as np
import pytest
import torch
from _support import assert_close

import ddf
from ddf.core import checks, storage
from ddf.fields import model_files, pddf, shape_field
from ddf.models import shape_vae

PAPER = pddf.PDDFConfig((512,) * 4 + (256,) * 4, 1.0, 1.0, "relu", 1.0)


def test_the_paper_decoder_has_the_papers_parameters():
    with torch.device("meta"):
        decoder = pddf.ConditionalPDDF(PAPER, 400)
    counts = [pddf.count_parameters(part) for part in (decoder, decoder.field, decoder.modulator)]
    assert counts == [3_467_268, 1_121_284, 2_345_984]


def test_a_plain_field_is_the_decoder_at_a_latent():
    decoder = _generative.vae().decoder.double()
    latent = torch.linspace(-1, 1, 5).double()
    positions, directions = (values.double() for values in _models.points(40))
    plain = shape_vae.plain_field(decoder, latent).double()
    assert_close(plain(positions, directions), decoder.field(positions, directions, decoder.modulator(latent)))
    apart = plain(positions, directions) - decoder.field(positions, directions)
    assert float(apart.detach().abs().max()) > 1e-3


def test_a_sample_opens_as_any_field_does(tmp_path):
    model = _generative.vae()
    plain = shape_vae.plain_field(model.decoder, torch.ones(5))
    shape_vae.write_field(tmp_path, plain, 2.5, {"fingerprint": "x", "seed": 0, "sources": {}})
    loaded = shape_field.load(tmp_path)
    positions, directions = _models.points(10)
    assert_close(loaded.field(positions, directions), plain(positions, directions))
    assert loaded.field_from_mesh.scale == 2.5 and loaded.upper.tolist() == [1.0, 1.0, 1.0]
    found = ddf.load(tmp_path).query(positions.double().numpy() / 2.5, directions.double().numpy(), ("visibility",))
    assert_close(found["visibility"], pddf.visibility(plain(positions, directions)), atol=1e-4)


def test_a_file_of_another_kind_is_refused(tmp_path):
    storage.save_tensors(tmp_path / model_files.MODEL, {"x": np.zeros(1)}, {"kind": "ddf"})
    with pytest.raises(checks.InputError, match="of this kind; give a folder that stage train_vae wrote"):
        shape_vae.load(tmp_path)


def test_a_model_is_loaded_as_it_was_written(tmp_path):
    model = _generative.vae()
    model.field_scale.fill_(2.25)
    record = {"kind": shape_vae.KIND, "vae": dataclasses.asdict(_generative.VAE)}
    storage.save_tensors(tmp_path / model_files.MODEL, dict(model.state_dict()), record)
    loaded = shape_vae.load(tmp_path)
    assert loaded.config == _generative.VAE and float(loaded.field_scale) == 2.25
    assert_close(loaded.decoder.field.network.head.weight, model.decoder.field.network.head.weight)
