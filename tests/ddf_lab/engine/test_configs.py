"""Every experiment file loads, section by section, into the dataclass of the module that uses it."""

import dataclasses
from dataclasses import is_dataclass

import pytest
from _pipeline import FILES

from ddf.fields import cloud_projection
from ddf.models import reconstruction_models, reconstruction_settings
from ddf.reconstruction import one_image
from ddf_lab.run import KINDS, SECTIONS, Run, class_of

CONFIGS = [path for path in FILES if Run.read(path).kind == "reconstruction"]


def test_every_section_names_its_dataclass_and_is_of_an_experiment():
    for section in SECTIONS:
        assert is_dataclass(class_of(section)), section
    assert {name for names in KINDS.values() for name in names} == set(SECTIONS)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_section_loads(path):
    run = Run.read(path)
    assert tuple(run.sections()) == KINDS[run.kind]


def test_commands_draw_clouds_as_the_default_experiment_does():
    (path,) = (path for path in CONFIGS if path.stem == "cpu")
    section = Run.read(path).section(reconstruction_settings.PointcloudsConfig)
    assert section.cloud == cloud_projection.USUAL
    assert section.shape_correction == reconstruction_settings.ShapeCorrectionConfig()
    assert section.correction == one_image.CAMERA


def _shapes(part, without=()):
    return {name: value.shape for name, value in part.state_dict().items() if not name.startswith(without)}


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_both_models_have_one_decoder(path):
    """Layer by layer: only what goes in and what comes out differs, and the encoders are the same."""
    train = Run.read(path).section(reconstruction_settings.TrainConfig)
    section = Run.read(path).section(reconstruction_settings.DDFConfig)
    ours = reconstruction_models.DDFModel(train, section.field)
    theirs = reconstruction_models.PCSirenModel(train)
    pairs = [(getattr(ours, name), getattr(theirs, name)) for name in ("shape_encoder", "camera_encoder")]
    for one, other in (*pairs, (ours.decoder.modulator, theirs.decoder.modulator)):
        assert _shapes(one) == _shapes(other)
    one, other = ours.decoder.field.network, theirs.decoder.network
    ends = ("layers.0.weight", "head")
    assert one.omegas == other.omegas and _shapes(one, ends) == _shapes(other, ends)
    assert one.layers[0].weight.shape == (len(other.layers[0].weight), 6)
    assert one.head.weight.shape[1] == other.head.weight.shape[1]


def test_the_papers_way_at_small_sizes_has_the_papers_losses_samples_cameras_and_clouds():
    both = {name: Run.read(path).sections() for path in CONFIGS if (name := path.stem) in ("cpu_paper", "paper")}
    small, paper = both["cpu_paper"], both["paper"]
    assert small["ddf"].weights == paper["ddf"].weights and small["ddf"].field == paper["ddf"].field
    assert (small["ddf"].mask_weight, small["ddf"].mask_pixels, small["ddf"].proposals) == (10.0, None, None)
    assert small["train"].azimuth == paper["train"].azimuth == "angle"
    for name, count in paper["ddf"].counts.items():
        assert small["ddf"].counts[name] == pytest.approx(count / 25, abs=3)
    ours, theirs = (dataclasses.asdict(one["pointclouds"].cloud) for one in (small, paper))
    assert {key for key in ours if ours[key] != theirs[key]} <= {"temperature", "inverse_depth"}
    assert small["pointclouds"].shape_correction is None and small["pointclouds"].pcsiren_inputs == "random"
    assert small["pointclouds"].correction.free == paper["pointclouds"].correction.free
    assert small["pcsiren"].truth_points == small["pcsiren"].points
