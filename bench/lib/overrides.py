"""Settings of a config with some of them changed, for tables of what each is worth."""

import copy
import functools
from collections.abc import Mapping
from typing import Any

from ddf.core import checks

ABSENT = "(left out)"  # a key that the changed config does not have


def changed(settings: Mapping[str, Any], changes: Mapping[str, Any], where: str) -> dict[str, Any]:
    """A copy with other values.

    Args:
      changes: dotted key to the other value, or `ABSENT`.
      where: what the settings are, for messages.
    Raises:
      InputError: a setting has that value already, so the change is none.
      KeyError: there is no such key.
    """
    whole = copy.deepcopy(dict(settings))
    for key, value in changes.items():
        *path, last = key.split(".")
        section = functools.reduce(lambda inner, part: inner[part], path, whole)
        if section[last] == value:
            raise checks.InputError(f"{where}: {key} is {value} already, so nothing would be changed")
        if value == ABSENT:
            del section[last]
        else:
            section[last] = value
    return whole
