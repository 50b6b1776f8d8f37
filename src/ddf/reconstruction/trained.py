"""Trained models from the files that `training_loop.fit` wrote: the record inside says how they are built."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ddf.core import config
from ddf.reconstruction import reconstruction_models, settings
from ddf.training import training_loop


def ddf(folder: Path, record: Mapping[str, Any]) -> tuple[reconstruction_models.DDFModel, int]:
    """The DDF model of a folder, in evaluation mode, and the image size that it takes.

    Args:
      record: of its model file (`storage.load_metadata`), of kind `ddf`.
    Raises:
      InputError: the file is damaged, or its record names unknown settings.
    """
    train = config.parse(record["train"], settings.TrainConfig, f"{folder}: train")
    section = config.parse(record["section"], settings.DDFConfig, f"{folder}: ddf")
    model = reconstruction_models.ddf_model(train, section)
    training_loop.load_model(model, folder)
    return model, train.image_size


def pcsiren(folder: Path, record: Mapping[str, Any]) -> tuple[reconstruction_models.PCSirenModel, int]:
    """As `ddf`, for a record of kind `pcsiren`."""
    train = config.parse(record["train"], settings.TrainConfig, f"{folder}: train")
    model = reconstruction_models.pcsiren_model(train)
    training_loop.load_model(model, folder)
    return model, train.image_size
