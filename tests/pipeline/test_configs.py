"""Every experiment file loads, section by section, into the dataclass of the module that uses it."""

import dataclasses
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest

from ddf.cli import cloud_settings
from ddf.core import config
from ddf.data import dataset, mesh_preparation, sampling
from ddf.evaluation import scoring
from ddf.export import onnx_file
from ddf.fields import pddf as ddf_fields
from ddf.reconstruction import inference, training_steps
from ddf.report.experiment import experiment_page
from ddf.shape import fitting

FILES = sorted((Path(__file__).resolve().parents[2] / "configs").glob("*.yaml"))
FITS = [path for path in FILES if path.stem.endswith("fit")]  # of single shapes: the section `fit` alone
CONFIGS = [path for path in FILES if path not in FITS]
CLASSES: dict[str, Any] = {
    "dataset": dataset.DatasetConfig,
    "meshes": mesh_preparation.MeshesConfig,
    "samples": sampling.SamplesConfig,
    "train": training_steps.TrainConfig,
    "ddf": training_steps.DDFConfig,
    "pcsiren": training_steps.PCSirenConfig,
    "pointclouds": inference.PointcloudsConfig,
    "evaluate": scoring.EvaluateConfig,
    "report": experiment_page.ReportConfig,
    "export": onnx_file.ExportConfig,
}
FIT: dict[str, Any] = {"fit": fitting.FitConfig}


def test_sections_are_those_of_the_loader():
    assert tuple(CLASSES) == config.SECTIONS
    assert tuple(FIT) == config.FIT_SECTIONS


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_every_section_loads(path):
    assert set(config.read(path)) == set(CLASSES)
    for section, cls in CLASSES.items():
        assert isinstance(config.load(path, section, cls), cls)


def test_commands_draw_clouds_as_the_default_experiment_does():
    (path,) = (path for path in CONFIGS if path.stem == "cpu")
    section = config.load(path, "pointclouds", inference.PointcloudsConfig)
    assert (section.cloud, section.scale_quantile) == (cloud_settings.cloud("z"), cloud_settings.SCALE_QUANTILE)
    assert dataclasses.asdict(cloud_settings.cloud()) == {**cloud_settings.CLOUD, "mirror": None}
    assert section.shape_correction is not None
    assert dataclasses.asdict(section.shape_correction) == cloud_settings.SHAPE_CORRECTION


@pytest.mark.parametrize("path", FITS, ids=lambda path: path.stem)
def test_fit_files_load_and_write_every_value_out(path):
    assert set(config.read(path)) == set(FIT)
    assert isinstance(config.load(path, "fit", fitting.FitConfig), fitting.FitConfig)
    assert _keys_left_to_defaults(config.read(path)["fit"], fitting.FitConfig) == []


def test_paper_fit_has_the_published_field():
    path = next(path for path in FITS if path.stem == "paper_fit")
    assert config.load(path, "fit", fitting.FitConfig).field == ddf_fields.PAPER_SINGLE_SHAPE


def _keys_left_to_defaults(given: dict[str, Any], cls: Any) -> list[str]:
    missing = []
    hints = config._hints(cls)
    for field in fields(cls):
        if field.name not in given:
            missing.append(field.name)
        elif is_dataclass(hints[field.name]):
            missing += [f"{field.name}.{key}" for key in _keys_left_to_defaults(given[field.name], hints[field.name])]
    return missing


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_every_value_is_written_out(path):
    sections = config.read(path)
    left = {name: _keys_left_to_defaults(sections[name], cls) for name, cls in CLASSES.items()}
    assert {name: keys for name, keys in left.items() if keys} == {}


def test_paper_config_builds_the_published_models():
    path = next(path for path in CONFIGS if path.stem == "paper")
    train = config.load(path, "train", CLASSES["train"])
    ddf_model = training_steps.ddf_model(train, config.load(path, "ddf", CLASSES["ddf"]))
    pc_siren = training_steps.pcsiren_model(train, config.load(path, "pcsiren", CLASSES["pcsiren"]))
    assert ddf_fields.count_parameters(ddf_model) == 25_647_367
    assert ddf_fields.count_parameters(pc_siren) == 25_645_574
    assert ddf_fields.count_parameters(ddf_fields.PDDF(ddf_fields.PAPER_SINGLE_SHAPE)) == 1_581_572
