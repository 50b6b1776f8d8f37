"""The shape VAE, its encoder of points, sizes as published, and files that stay readable."""

import dataclasses
import json
from pathlib import Path

import _generative
import _models
import numpy as np
import pytest
import torch
from _support import assert_close

import ddf
from ddf.core import checks, config, storage
from ddf.fields import model_files, pddf, shape_field
from ddf.models import generative_models, generative_settings


def test_the_order_of_the_points_does_not_count_and_normals_do():
    torch.manual_seed(0)
    posterior = generative_models.Posterior(8, width=16).eval()
    positions, normals = torch.randn((2, 2, 50, 3), generator=torch.Generator().manual_seed(0))
    turned = torch.randperm(50)
    mean, log_variance = posterior(positions, normals)
    assert_close(posterior(positions[:, turned], normals[:, turned])[0], mean)
    assert float((posterior(positions, -normals)[0] - mean).detach().abs().max()) > 1e-3
    assert mean.shape == log_variance.shape == (2, 8)


def test_divergence_has_its_closed_form_and_agrees_with_torch():
    assert_close(generative_models.divergence(torch.zeros(1, 3), torch.zeros(1, 3)), torch.zeros(1, 3))
    assert float(generative_models.divergence(torch.tensor([[2.0]]), torch.zeros(1, 1))) == pytest.approx(2.0)
    mean, log_variance = torch.tensor([[0.3, -1.2]]), torch.tensor([[-0.7, 0.4]])
    own = torch.distributions.Normal(mean, (0.5 * log_variance).exp())
    wanted = torch.distributions.kl_divergence(own, torch.distributions.Normal(0.0, 1.0))
    assert_close(generative_models.divergence(mean, log_variance), wanted)


def test_a_sample_opens_as_any_field_does(tmp_path):
    model = _generative.vae()
    plain = generative_models.plain_field(model.decoder, torch.ones(5))
    shape = shape_field.in_cube(plain, 1 / 2.5)
    shape.save(tmp_path)
    loaded = shape_field.load(tmp_path)
    positions, directions = _models.points(10)
    assert_close(loaded.field(positions, directions), plain(positions, directions))
    assert loaded.field_from_mesh.scale == 2.5 and loaded.upper.tolist() == [1.0, 1.0, 1.0]
    found = ddf.load(tmp_path).query(positions.double().numpy() / 2.5, directions.double().numpy(), ("visibility",))
    assert_close(found["visibility"], pddf.visibility(plain(positions, directions)), atol=1e-4)


def _recorded(folder, change=lambda record: None):
    """What is read of a file whose record was changed."""
    sections = {name: dataclasses.asdict(getattr(_generative, name.upper())) for name in ("vae", "gan")}
    record = json.loads(json.dumps({"kind": "x", **sections}))
    change(record)
    storage.save_tensors(folder / model_files.MODEL, {"x": np.zeros(1)}, record)
    wanted = {"vae": generative_settings.VAEConfig, "gan": generative_settings.GANConfig}
    return generative_models.recorded(folder, "x", "train_x", **wanted)[1]


def test_sections_are_read_as_they_were_written_and_keys_that_are_gone_are_passed_over(tmp_path):
    def add(record):
        record["vae"]["gone"] = record["vae"]["loop"]["gone"] = record["vae"]["field"]["gone"] = {"a": 1}

    assert _recorded(tmp_path) == _recorded(tmp_path, add) == [_generative.VAE, _generative.GAN]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda record: record["vae"].update(latent_features="many"), r"vae\.latent_features must be of type int; got"),
        (lambda record: record.pop("gan"), "its record has no section gan"),
        (lambda record: record.update(kind="y"), "holds no model of this kind; give a folder that stage train_x wrote"),
    ],
)
def test_records_that_do_not_fit_are_refused(tmp_path, change, words):
    with pytest.raises(checks.InputError, match=words):
        _recorded(tmp_path, change)


PAPER = Path(__file__).resolve().parents[3] / "configs" / "paper_generative.yaml"


def test_the_paper_config_has_the_published_networks():
    given = config.layers(PAPER)
    vae = config.resolve(given, "vae", generative_settings.VAEConfig)
    gan = config.resolve(given, "gan", generative_settings.GANConfig)
    assert generative_models.parameter_counts(vae, gan) == {
        "point_encoder": 1_347_488,
        "posterior_heads": 641_600,
        "decoder": 3_467_268,
        "decoder_field": 1_121_284,
        "decoder_modulator": 2_345_984,
        "colours_from_normals": 8_038_403,
        "normals_from_colours": 7_837_699,
        "texture_encoder": 273_232,
        "critic": 10_141_441,
        "generator_2d": 12_220_675,
    }
