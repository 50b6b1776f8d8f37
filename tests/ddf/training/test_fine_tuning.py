"""Training that goes on from a trained model: its sizes and weights, the box of both, what is refused, the notes."""

import dataclasses
import functools

import _hand_made
import _models
import pytest
import torch
import yaml

from ddf.core import checks, storage
from ddf.fields import model_files
from ddf.models import line_field
from ddf.training import line_steps, training_loop
from ddf_lab import run
from ddf_lab.engine import runner

TRAIN, OWN = _hand_made.TRAIN, line_field.LineFieldConfig(places=8, width=16, steps=4, rays=60)
OTHER = dataclasses.replace(TRAIN, latent_features=9, encoder_width=5)
FINE = line_steps.ImageTrainConfig(places=12, width=20, steps=2, rays=36, learning_rate=1e-4)


def _train(train, own, folder, steps, start=None):
    """As the stage does; the model, and the loss of the first step before it was taken."""
    torch.manual_seed(steps)
    images, shapes, samples = _hand_made.images(), _hand_made.shapes(), _hand_made.samples()
    model = line_field.ImageDDFModel(train, own)
    model.fit_box(shapes)
    model.fit_cameras(images)
    if start is not None:
        line_steps.start_from(model, start)
    step = functools.partial(line_steps.ddf_image_step, model, images, shapes, samples, train, own)
    record = {"fingerprint": "x", "kind": "ddf_image", "train": dataclasses.asdict(train),
              "section": dataclasses.asdict(own)}  # fmt: skip
    before = float(step(0)[0].detach())
    training_loop.fit(model, model.parameter_groups(), step, steps, own.loop(train.loop), folder, record, "")
    return model, before


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    folder = tmp_path_factory.mktemp("trained") / "chair"
    _train(TRAIN, OWN, folder, OWN.steps)
    return folder


def test_it_goes_on_with_the_weights_and_sizes_of_the_start(trained, tmp_path):
    how = dataclasses.replace(FINE, start=str(trained))
    train, own, file = how.started(OTHER, "chair")
    assert dataclasses.asdict(train) == dataclasses.asdict(TRAIN) and type(own) is line_field.LineFieldConfig
    assert (own.places, own.width, own.steps, own.rays, own.learning_rate) == (8, 16, 2, 36, 1e-4)
    assert file == trained / model_files.MODEL
    own = dataclasses.replace(own, rays=OWN.rays)
    fresh, fine = (_train(train, own, tmp_path / str(start is None), 2, start) for start in (None, file))
    assert fine[1] < fresh[1]  # at once
    loaded = line_field.load(tmp_path / "False").network.state_dict()
    assert all(torch.equal(value, loaded[name]) for name, value in fine[0].state_dict().items())


def test_box_and_cameras_hold_those_of_both(trained):
    model = line_field.ImageDDFModel(TRAIN, OWN)
    known = line_field.load(trained).network
    model.decoder.upper.copy_(torch.tensor([2.0, 0.0, 3.0]))
    model.camera_head.lowest.copy_(torch.tensor([-9.0, 9.0, 0.1]))
    model.camera_head.highest.copy_(torch.tensor([9.0, 9.0, 0.1]))
    line_steps.start_from(model, trained / model_files.MODEL)
    assert model.decoder.upper.tolist() == [2.0, float(known.decoder.upper[1]), 3.0]
    assert torch.equal(model.decoder.lower, -model.decoder.upper)
    assert model.camera_head.lowest.tolist() == pytest.approx([-9.0, float(known.camera_head.lowest[1]), 0.1])
    assert model.camera_head.highest.tolist() == pytest.approx([9.0, 9.0, float(known.camera_head.highest[2])])
    assert torch.equal(model.camera_head.mean, known.camera_head.mean)  # what the weights answer in
    assert torch.equal(model.decoder.first.weight, known.decoder.first.weight)


def test_what_cannot_be_a_start_is_told(trained, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no reconstruction of that name; there are .*chair"):
        dataclasses.replace(FINE, start="shipped").started(TRAIN, "stool")
    other = _models.write_model(tmp_path / "other")
    with pytest.raises(checks.InputError, match="holds no image-feature DDF"):
        dataclasses.replace(FINE, start=str(other)).started(TRAIN, "chair")
    larger = dataclasses.replace(TRAIN, image_size=64)
    with pytest.raises(checks.InputError, match=r"train\.image_size must be 32"):
        dataclasses.replace(FINE, start=str(trained)).started(larger, "chair")


def test_other_weights_at_the_start_are_another_input_of_the_stage(trained, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sections = {"dataset": {"source": "synthetic", "categories": {"chair": 2}}, "train": {"image_size": 32}}
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump({**sections, "ddf_image": {"start": str(trained)}}))
    noted = tmp_path / "artifacts" / "mine" / "start.sha256"
    experiment = run.Run.read("mine.yaml")
    runner._record(experiment, 1, None)
    before = noted.read_text()
    assert before == f"{storage.checksum(trained / model_files.MODEL)}\n"
    tensors, record = storage.load_tensors(trained / model_files.MODEL, "torch")
    tensors["decoder.head.bias"] += 1
    storage.save_tensors(trained / model_files.MODEL, tensors, record)
    runner._record(experiment, 1, None)
    assert noted.read_text() != before
