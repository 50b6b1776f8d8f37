"""The records in the files of generative models: of which kind the file is, and how its network is built."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from ddf.core import checks, config, storage
from ddf.fields import model_files

T = TypeVar("T")


def read(folder: Path, kind: str, stage: str) -> Mapping[str, Any]:
    """The record of a folder's model.

    Args:
      kind: that it must be of. stage: the one that writes such files.
    Raises:
      FileNotFoundError: there is no model. InputError: the file is damaged, or holds something else.
    """
    record = storage.load_metadata(folder / model_files.MODEL)
    if record.get("kind") != kind:
        raise checks.InputError(f"{folder}: holds no model of this kind; give a folder that stage {stage} wrote")
    return record


def section(record: Mapping[str, Any], name: str, cls: type[T], folder: Path) -> T:
    """A section of the record as the dataclass that it has today; keys that are gone are passed over.

    How the network was trained may be said in other words by now. What its layers need must be there.

    Raises:
      InputError: the section is not there, or a value does not fit.
    """
    if name not in record:
        raise checks.InputError(f"{folder}: its record has no section {name}")
    return config.recorded(record[name], cls, f"{folder}: {name}")
