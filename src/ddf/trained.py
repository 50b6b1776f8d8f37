"""Trained reconstruction models from the files that `training.fit` wrote: the record inside says how they are built."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ddf import config, reconstruction, si3dr_training, training


def ddf(folder: Path, record: Mapping[str, Any]) -> tuple[reconstruction.DDFModel, int]:
    """The DDF model of a folder, in evaluation mode, and the image size that it takes.

    Args:
      record: of its model file (`storage.load_metadata`), of kind `ddf`.
    Raises:
      InputError: the file is damaged, or its record names unknown settings.
    """
    train = config.parse(record["train"], si3dr_training.TrainConfig, f"{folder}: train")
    section = config.parse(record["section"], si3dr_training.DDFConfig, f"{folder}: ddf")
    model = si3dr_training.ddf_model(train, section)
    training.load_model(model, folder)
    return model, train.image_size


def pcsiren(folder: Path, record: Mapping[str, Any]) -> tuple[reconstruction.PCSirenModel, int]:
    """As `ddf`, for a record of kind `pcsiren`."""
    train = config.parse(record["train"], si3dr_training.TrainConfig, f"{folder}: train")
    section = config.parse(record["section"], si3dr_training.PCSirenConfig, f"{folder}: pcsiren")
    model = si3dr_training.pcsiren_model(train, section)
    training.load_model(model, folder)
    return model, train.image_size
