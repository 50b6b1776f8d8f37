"""Trained models from their files."""

import _models
import torch

from ddf.core import storage
from ddf.fields import model_files
from ddf.models import trained


def test_a_model_is_read_whatever_its_record_says_of_its_training(tmp_path):
    model = _models.ddf_model()
    _models.write_model(tmp_path)
    path = tmp_path / model_files.MODEL
    tensors, record = storage.load_tensors(path, framework="torch")
    record["section"] = {"field": record["section"]["field"], "a setting of another version": 1.0}
    storage.save_tensors(path, tensors, record)
    read, size = trained.ddf(tmp_path, storage.load_metadata(path))
    assert size == _models.TRAIN.image_size and not read.training
    for name, values in model.state_dict().items():
        assert torch.equal(values, read.state_dict()[name])
