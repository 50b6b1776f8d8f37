"""Every experiment file loads, section by section, into the dataclass of the module that uses it."""

import dataclasses
import typing
from collections.abc import Iterator
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any

import pytest

from ddf.core import config, schema
from ddf.fields import pddf as ddf_fields
from ddf.fields import stored_fields
from ddf.fit import fit_settings
from ddf.models import reconstruction_models, reconstruction_settings
from ddf.reconstruction import one_image
from ddf_lab.run import KINDS, SECTIONS, Run, class_of

FILES = [*sorted((Path(__file__).resolve().parents[3] / "configs").glob("*.yaml")), *config.PACKAGED.glob("*.yaml")]
CONFIGS = [path for path in FILES if Run.read(path).kind == "reconstruction"]
MOST_LINES = 350


def _settings(cls: type, prefix: str) -> Iterator[tuple[str, Any]]:
    """Dotted keys that a file may give, and their fields; a mapping is one."""
    hints = typing.get_type_hints(cls)
    for name, field in schema.fields_of(cls).items():
        part = schema.part_of(hints[name])
        if part is None:
            yield f"{prefix}.{name}", field
        else:
            yield from _settings(part, f"{prefix}.{name}")


SETTINGS = dict(pair for section in SECTIONS for pair in _settings(class_of(section), section))


def test_every_section_names_its_dataclass_and_is_of_an_experiment():
    for section in SECTIONS:
        assert is_dataclass(class_of(section)), section
    assert {name for names in KINDS.values() for name in names} == set(SECTIONS)


def test_each_setting_says_what_it_is_and_files_are_short():
    assert len(SETTINGS) > 100
    assert all(field.metadata.get("says") for field in SETTINGS.values())
    assert sum(len(path.read_text().splitlines()) for path in FILES) <= MOST_LINES


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_section_loads_and_restates_no_value(path):
    run = Run.read(path)
    assert tuple(run.sections()) == KINDS[run.kind]
    for name, layers in run.given.items():
        own = [given for where, given in layers if where == f"{path}: {name}"]
        below = config.resolve(
            {name: [layer for layer in layers if layer[0] != f"{path}: {name}"]}, name, class_of(name)
        )
        said = list(_given(own[0], config.plain(below))) if own else []
        assert all(value != before or key in STATED for key, value, before in said), [s for s in said if s[1] == s[2]]


STATED = ("source", "held_out")  # what the paper's files say aloud


def _given(own: dict[str, Any], below: dict[str, Any] | None) -> Iterator[tuple[str, Any, Any]]:
    """Keys that a file gives, their values, and what they would be without."""
    for key, value in own.items():
        before = (below or {}).get(key)
        if (
            isinstance(value, dict)
            and isinstance(before, dict)
            and key not in ("counts", "batch", "samples", "categories")
        ):
            yield from _given(value, before)
        else:
            yield key, value, before


def test_commands_draw_clouds_as_the_default_experiment_does():
    (path,) = (path for path in CONFIGS if path.stem == "cpu")
    section = Run.read(path).section(reconstruction_settings.PointcloudsConfig)
    assert section.cloud == stored_fields.cloud_config()
    assert section.shape_correction == reconstruction_settings.ShapeCorrectionConfig()
    assert section.correction == one_image.CAMERA


def test_paper_fit_has_the_published_field():
    path = next(path for path in FILES if path.stem == "paper_fit")
    assert Run.read(path).section(fit_settings.FitConfig).field == ddf_fields.PAPER_SINGLE_SHAPE


def test_both_models_have_one_decoder_in_every_file():
    """Layer by layer: only what goes in and what comes out differs, and the encoders are the same."""
    for path in CONFIGS:
        train = Run.read(path).section(reconstruction_settings.TrainConfig)
        ddf = reconstruction_models.DDFModel(train, Run.read(path).section(reconstruction_settings.DDFConfig).field)
        pcsiren = reconstruction_models.PCSirenModel(train)
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
    train = Run.read(path).section(reconstruction_settings.TrainConfig)
    ddf_model = reconstruction_models.DDFModel(train, Run.read(path).section(reconstruction_settings.DDFConfig).field)
    pc_siren = reconstruction_models.PCSirenModel(train)
    assert ddf_fields.count_parameters(ddf_model) == 25_647_367
    assert ddf_fields.count_parameters(pc_siren) == 25_645_574
    assert ddf_fields.count_parameters(ddf_fields.PDDF(ddf_fields.PAPER_SINGLE_SHAPE)) == 1_581_572
