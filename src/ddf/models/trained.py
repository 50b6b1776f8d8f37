"""Trained models from the files that `training_loop.fit` wrote: the record inside says how they are built."""

import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from torch import Tensor

from ddf.core import config, storage
from ddf.data.batches import category_data
from ddf.fields import framed_field, model_files
from ddf.models import familiarity, image_encoding, reconstruction_models, reconstruction_settings


def ddf(folder: Path, record: Mapping[str, Any]) -> tuple[reconstruction_models.DDFModel, int]:
    """The DDF model of a folder, in evaluation mode, and the image size that it takes.

    Args:
      record: of its model file (`storage.load_metadata`), of kind `ddf`.
        Of its section `ddf` the field alone is read: how the model was trained may be said in other words by now.
    Raises:
      InputError: the file is damaged, or its record names unknown settings.
    """
    with framed_field.record_of(folder):
        train = config.recorded(record["train"], reconstruction_settings.TrainConfig, "train")
        field = config.recorded(record["section"]["field"], reconstruction_settings.FieldConfig, "ddf.field")
    make = functools.partial(reconstruction_models.ddf_model, train, field)
    return model_files.built(make, folder, familiarity.PREFIX), train.image_size


def add_known(model: reconstruction_models.DDFModel, images: category_data.ImageSet, folder: Path) -> None:
    """Put what tells how usual an image is (`familiarity`) into the model's file, beside its weights."""
    path = folder / model_files.MODEL
    tensors, record = storage.load_tensors(path, framework="torch")
    weights, _ = familiarity.parted(tensors)
    known = familiarity.measure(image_encoding.image_stages(model.eval(), images))
    storage.save_tensors(path, weights | known, record)


def known(folder: Path) -> dict[str, Tensor]:
    """What the model's file says of its training images; nothing where it was written without."""
    return familiarity.parted(storage.load_tensors(folder / model_files.MODEL, framework="torch")[0])[1]


def pcsiren(folder: Path, record: Mapping[str, Any]) -> tuple[reconstruction_models.PCSirenModel, int]:
    """As `ddf`, for a record of kind `pcsiren`."""
    with framed_field.record_of(folder):
        train = config.recorded(record["train"], reconstruction_settings.TrainConfig, "train")
    return model_files.built(lambda: reconstruction_models.pcsiren_model(train), folder), train.image_size
