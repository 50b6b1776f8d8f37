"""Files of generative models stay readable when the words for how they were trained change."""

import dataclasses
import json
from pathlib import Path

import _generative
import pytest

from ddf.core import checks, config
from ddf.models import generative_settings, records


def _record():
    """As a file holds it: plain values."""
    return json.loads(
        json.dumps({name: dataclasses.asdict(getattr(_generative, name.upper())) for name in ("vae", "gan")})
    )


def test_a_section_is_read_as_it_was_written():
    record = _record()
    assert records.section(record, "vae", generative_settings.VAEConfig, Path("here")) == _generative.VAE
    assert records.section(record, "gan", generative_settings.GANConfig, Path("here")) == _generative.GAN


def test_keys_that_are_gone_are_passed_over_however_deep():
    record = _record()
    record["vae"]["gone"] = record["vae"]["loop"]["gone"] = record["vae"]["field"]["gone"] = {"a": 1}
    assert records.section(record, "vae", generative_settings.VAEConfig, Path("here")) == _generative.VAE
    with pytest.raises(checks.InputError, match="unknown key"):
        config.parse(record["vae"], generative_settings.VAEConfig, "here")


def test_a_value_that_does_not_fit_and_a_missing_section_are_named():
    record = _record()
    record["vae"]["latent_features"] = "many"
    with pytest.raises(checks.InputError, match=r"here: vae\.latent_features must be of type int; got 'many'"):
        records.section(record, "vae", generative_settings.VAEConfig, Path("here"))
    with pytest.raises(checks.InputError, match="no section vae"):
        records.section({}, "vae", generative_settings.VAEConfig, Path("here"))
