"""Every experiment file loads, section by section, into the dataclass of the module that uses it."""

import dataclasses
import functools
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest

from ddf.core import config
from ddf.fields import pddf as ddf_fields
from ddf.fit import cloud_defaults, fit_settings
from ddf.models.reconstruction import reconstruction_models, settings
from ddf_lab.engine import experiments
from ddf_lab.run import SECTIONS, Run, class_of

FILES = sorted((Path(__file__).resolve().parents[3] / "configs").glob("*.yaml"))
KINDS: dict[Path, experiments.Kind] = {path: experiments.read(Run.read(path)).kind for path in FILES}
GENERATIVE = [path for path in FILES if KINDS[path] == "generative"]
CONFIGS = [path for path in FILES if KINDS[path] == "reconstruction"]


def test_every_section_names_its_dataclass():
    for section in SECTIONS:
        assert is_dataclass(class_of(section)), section


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_section_loads(path):
    run = Run.read(path)
    assert set(run.sections()) == set(experiments.KINDS[KINDS[path]])
    for section, value in run.sections().items():
        assert type(value) is class_of(section)
        assert run.section(type(value)) == value


def test_commands_draw_clouds_as_the_default_experiment_does():
    (path,) = (path for path in CONFIGS if path.stem == "cpu")
    section = Run.read(path).section(settings.PointcloudsConfig)
    assert section.cloud == cloud_defaults.cloud()
    assert dataclasses.asdict(cloud_defaults.cloud()) == cloud_defaults.CLOUD
    assert section.shape_correction is not None
    assert dataclasses.asdict(section.shape_correction) == cloud_defaults.SHAPE_CORRECTION


def test_paper_fit_has_the_published_field():
    path = next(path for path in FILES if path.stem == "paper_fit")
    assert Run.read(path).section(fit_settings.FitConfig).field == ddf_fields.PAPER_SINGLE_SHAPE


def _left_out(given: dict[str, Any], whole: Any, prefix: str = "") -> dict[str, Any]:
    """Dotted keys that a section of a file leaves to their defaults, and these."""
    found = {}
    for field in fields(whole):
        value, key = getattr(whole, field.name), f"{prefix}{field.name}"
        if field.name not in given:
            found[key] = value
        elif is_dataclass(value) and given[field.name] is not None:
            found |= _left_out(given[field.name], value, f"{key}.")
    return found


@pytest.mark.parametrize("path", [*CONFIGS, *GENERATIVE], ids=lambda path: path.stem)
def test_what_a_file_leaves_out_is_the_papers_way(path):
    """A file says its sizes and its departures; whatever else there is has its paper's value."""
    published_by = "paper_generative" if path in GENERATIVE else "paper"
    paper = Run.read(next(path for path in FILES if path.stem == published_by)).sections()
    for name, section in Run.read(path).sections().items():
        for key, value in _left_out(config.read(path)[name], section).items():
            published = functools.reduce(getattr, key.split("."), paper[name])
            assert value == published, (name, key)


def test_both_models_have_one_decoder_in_every_file():
    """Layer by layer: only what goes in and what comes out differs, and the encoders are the same."""
    for path in CONFIGS:
        train = Run.read(path).section(settings.TrainConfig)
        ddf = reconstruction_models.ddf_model(train, Run.read(path).section(settings.DDFConfig).field)
        pcsiren = reconstruction_models.pcsiren_model(train)
        ours, theirs = ddf.decoder.field.network, pcsiren.decoder.network
        assert ours.omegas == theirs.omegas and len(ours.layers) == len(theirs.layers)
        for number, (one, other) in enumerate(zip(ours.layers, theirs.layers, strict=True)):
            assert one.weight.shape[0] == other.weight.shape[0]
            assert one.weight.shape == other.weight.shape or (number == 0 and one.weight.shape[1] == 6)
        assert ours.head.weight.shape[1] == theirs.head.weight.shape[1]
        for part in ("shape_encoder", "camera_encoder"):
            shapes = [
                {name: value.shape for name, value in getattr(model, part).state_dict().items()}
                for model in (ddf, pcsiren)
            ]
            assert shapes[0] == shapes[1], (path, part)
        shapes = [
            {name: value.shape for name, value in model.decoder.modulator.state_dict().items()}
            for model in (ddf, pcsiren)
        ]
        assert shapes[0] == shapes[1], path


def test_the_papers_way_at_small_sizes_has_the_papers_losses_samples_cameras_and_clouds():
    both = {name: Run.read(path).sections() for path in CONFIGS if (name := path.stem) in ("cpu_paper", "paper")}
    small, paper = both["cpu_paper"], both["paper"]
    assert small["ddf"].weights == paper["ddf"].weights and small["ddf"].field == paper["ddf"].field
    assert (small["ddf"].mask_weight, small["ddf"].mask_pixels, small["ddf"].proposals) == (10.0, None, None)
    assert small["train"].azimuth == paper["train"].azimuth == "angle"
    for name, count in paper["ddf"].counts.items():
        assert small["ddf"].counts[name] == pytest.approx(count / 25, abs=3)
    ours, theirs = (dataclasses.asdict(one["pointclouds"].cloud) for one in (small, paper))
    assert {key for key in ours if ours[key] != theirs[key]} <= {"temperature", "inverse_depth", "chunk_rays"}
    assert small["pointclouds"].shape_correction is None and small["pointclouds"].pcsiren_inputs == "random"
    assert small["pointclouds"].correction.free == paper["pointclouds"].correction.free
    assert small["pcsiren"].truth_points == small["pcsiren"].points


def test_paper_config_builds_the_published_models():
    path = next(path for path in CONFIGS if path.stem == "paper")
    train = Run.read(path).section(settings.TrainConfig)
    ddf_model = reconstruction_models.ddf_model(train, Run.read(path).section(settings.DDFConfig).field)
    pc_siren = reconstruction_models.pcsiren_model(train)
    assert ddf_fields.count_parameters(ddf_model) == 25_647_367
    assert ddf_fields.count_parameters(pc_siren) == 25_645_574
    assert ddf_fields.count_parameters(ddf_fields.PDDF(ddf_fields.PAPER_SINGLE_SHAPE)) == 1_581_572
