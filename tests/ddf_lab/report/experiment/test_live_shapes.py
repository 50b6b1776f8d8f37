"""Live pages of an experiment: the best, the median and the worst image, where the model is there."""

import gzip
import json
import re
from base64 import b64decode
from pathlib import Path

import _models
import numpy as np
import pandas as pd
import pytest
import torch
from _fake_experiment import FakeExperiment
from _support import assert_close

from ddf.data import shapenet
from ddf.fields import shape_field
from ddf.io import viewer_fields
from ddf_lab.evaluation import scoring
from ddf_lab.report.experiment import example_strips, live_shapes, stage_results
from ddf_lab.run import Run

NOTHING = pd.DataFrame()


def _results(experiment):
    """As `read_results` gives them, of the scores alone: the later the image the larger the error of DDF."""
    rows = [
        {"category": category, "id": shape, "view": view, "method": method, "column": "Pi_g-L", "chamfer_l2_sq": error}
        for category in experiment.categories
        for number, (shape, view) in enumerate(experiment.images(category))
        for method, error in ((scoring.DDF, 1e-3 * (1 + number)), (scoring.PC_SIREN, 1.0))
    ]
    index = json.loads((experiment.artifacts / "dataset" / "index.json").read_text())
    return stage_results.Results(
        name=experiment.name,
        index=index,
        table=NOTHING,
        trainings=[pd.DataFrame(rows)],
        cameras=NOTHING,
        shapes=NOTHING,
        logs={},
        measures={},
        packing_errors={},
        failures=NOTHING,
        costs={},
        settings={},
    )


@pytest.fixture
def experiment(tmp_path, monkeypatch):
    """Two categories, of which one has a model."""
    made = FakeExperiment(tmp_path, categories=("chair", "plane"), train=1, test=2)
    _models.write_model(made.artifacts / "train_ddf" / "chair")
    monkeypatch.chdir(tmp_path)
    return made


def test_a_category_without_a_model_is_left_out(experiment):
    live = live_shapes.drawn(Run(Path("configs/fake.yaml"), {}), _results(experiment)).live
    assert list(live) == ["chair"]
    (text,) = re.findall(r'id="ddf-page">(.*?)</script>', live["chair"].decode())
    names = [field["name"] for field in json.loads(text)["fields"]]
    assert names == ["best 1.000", "median 2.000", "worst 4.000"]


def test_a_damaged_model_breaks_nothing(experiment):
    (experiment.artifacts / "train_ddf" / "chair" / "model.safetensors").write_bytes(b"damaged")
    assert live_shapes.drawn(Run(Path("configs/fake.yaml"), {}), _results(experiment)).live == {}


def test_fields_are_those_of_the_images(experiment):
    live = live_shapes.drawn(Run(Path("configs/fake.yaml"), {}), _results(experiment)).live
    (block,) = re.findall(r'id="ddf-weights">(.*?)</script>', live["chair"].decode())
    numbers = np.frombuffer(gzip.decompress(b64decode(block)), np.float32).reshape(3, -1)
    model = _models.ddf_model()
    for row, image in zip(numbers, (0, 1, 3), strict=True):
        shape, view = experiment.images("chair")[image]
        file = shapenet.image_path(Path("artifacts/fake/dataset"), "00", shape, view)
        with torch.no_grad():
            latent = model.shape_encoder(shapenet.read_image(file, 32)[None])
            modulations = [values[0] for values in model.modulations(latent)]
        expected = viewer_fields.bake(shape_field.conditioned(model.field, modulations, 1.0), "x").numbers
        assert_close(row, expected, atol=1e-5)


def test_of_an_even_number_the_median_is_the_smaller_of_both():
    errors = {("a", view): example_strips.Errors(float(view), 0.0) for view in range(4)}
    assert [view for _, view in live_shapes.chosen(errors).values()] == [0, 1, 3]
