"""Every experiment file loads, section by section, into the dataclass of the module that uses it."""

import dataclasses
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest

from ddf.core import config
from ddf.fields import pddf as ddf_fields
from ddf.reconstruction import reconstruction_models, settings
from ddf.shape import cloud_defaults, fit_settings

FILES = sorted((Path(__file__).resolve().parents[2] / "configs").glob("*.yaml"))
FITS = [path for path in FILES if set(config.read(path)) == set(config.FIT_SECTIONS)]  # of single shapes
CONFIGS = [path for path in FILES if path not in FITS]


def test_every_section_names_its_dataclass():
    for section in config.SECTIONS | config.FIT_SECTIONS:
        assert is_dataclass(config.class_of(section)), section
        assert config.section_of(config.class_of(section)) == section


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_every_section_loads(path):
    found = config.load_all(path)
    assert set(found) == set(config.SECTIONS)
    for section, value in found.items():
        assert type(value) is config.class_of(section)
        assert config.load(path, type(value)) == value


def test_commands_draw_clouds_as_the_default_experiment_does():
    (path,) = (path for path in CONFIGS if path.stem == "cpu")
    section = config.load(path, settings.PointcloudsConfig)
    assert section.cloud == cloud_defaults.cloud()
    assert dataclasses.asdict(cloud_defaults.cloud()) == cloud_defaults.CLOUD
    assert section.shape_correction is not None
    assert dataclasses.asdict(section.shape_correction) == cloud_defaults.SHAPE_CORRECTION


@pytest.mark.parametrize("path", FITS, ids=lambda path: path.stem)
def test_fit_files_load(path):
    assert set(config.load_all(path)) == set(config.FIT_SECTIONS)


def test_paper_fit_has_the_published_field():
    path = next(path for path in FITS if path.stem == "paper_fit")
    assert config.load(path, fit_settings.FitConfig).field == ddf_fields.PAPER_SINGLE_SHAPE


def _keys_left_to_defaults(given: dict[str, Any], cls: Any) -> list[str]:
    missing = []
    hints = config._hints(cls)
    for field in fields(cls):
        if field.name not in given:
            missing.append(field.name)
        elif is_dataclass(hints[field.name]):
            missing += [f"{field.name}.{key}" for key in _keys_left_to_defaults(given[field.name], hints[field.name])]
    return missing


def test_the_default_experiment_writes_every_value_out():
    """Another file may leave a key to its default, so that a new key is said in this one alone."""
    sections = config.read(next(path for path in FILES if path.stem == "cpu"))
    left = {name: _keys_left_to_defaults(given, config.class_of(name)) for name, given in sections.items()}
    assert {name: keys for name, keys in left.items() if keys} == {}


def test_paper_config_builds_the_published_models():
    path = next(path for path in CONFIGS if path.stem == "paper")
    train = config.load(path, settings.TrainConfig)
    ddf_model = reconstruction_models.ddf_model(train, config.load(path, settings.DDFConfig))
    pc_siren = reconstruction_models.pcsiren_model(train)
    assert ddf_fields.count_parameters(ddf_model) == 25_647_367
    assert ddf_fields.count_parameters(pc_siren) == 25_645_574
    assert ddf_fields.count_parameters(ddf_fields.PDDF(ddf_fields.PAPER_SINGLE_SHAPE)) == 1_581_572
