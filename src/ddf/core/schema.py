"""Settings: the fields of a dataclass that a file or `--set` may give, each with default, unit, reason and source."""

import copy
import dataclasses
import operator
import types
import typing
from collections.abc import Iterator
from typing import Any, TypeVar, cast

from ddf.core import checks

T = TypeVar("T")


def setting(default: T, says: str, source: str = "", **bounds: int | float) -> T:
    """A field of a dataclass, as `dataclasses.field`, that a file may give.

    Args:
      says: what it is, with its unit, and why it is as it is.
      source: where the paper prints the default; empty where it does not.
      bounds: least, above, most, below; checked by `Checked`.
    """
    metadata = {"says": says, "source": source, **bounds}
    if isinstance(default, dict):
        return dataclasses.field(default_factory=lambda: copy.copy(default), metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def fixed(default: T, **bounds: int | float) -> T:
    """A field that no file gives: callers, commands and tests may."""
    return dataclasses.field(default=default, metadata=bounds)


class Checked:
    """A dataclass whose numbers are in bounds; InputError names the one that is not."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(cast(Any, self)):
            value, bounds = getattr(self, field.name), field.metadata.keys() & _BOUNDS.keys()
            if value is None or not bounds:
                continue
            for rule, (sign, fits) in _BOUNDS.items():
                if rule in bounds and not fits(value, field.metadata[rule]):
                    raise checks.InputError(f"{field.name} must be {sign} {field.metadata[rule]:g}; got {value}")
            if abs(value) == float("inf"):
                raise checks.InputError(f"{field.name} must be finite; got {value}")


_BOUNDS = {
    "least": (">=", operator.ge),
    "above": (">", operator.gt),
    "most": ("<=", operator.le),
    "below": ("<", operator.lt),
}


def fields_of(cls: type) -> dict[str, dataclasses.Field[Any]]:
    """The fields that a file may give: the settings among them, or all where none is one."""
    every = dataclasses.fields(cast(Any, cls))
    return {each.name: each for each in every if "says" in each.metadata} or {each.name: each for each in every}


def part_of(hint: Any) -> type | None:
    """The dataclass in a type such as `Part` or `Part | None`."""
    choices = typing.get_args(hint) if typing.get_origin(hint) in (types.UnionType, typing.Union) else (hint,)
    return next((each for each in choices if isinstance(each, type) and dataclasses.is_dataclass(each)), None)


@dataclasses.dataclass(frozen=True)
class Setting:
    """A setting of a section, or a part of it, behind which its own settings come.

    key: dotted. source: where the paper prints the default; empty where it does not.
    """

    key: str
    value: Any
    default: Any
    says: str
    source: str


def listed(section: Any, key: str, default: Any = None, source: str = "") -> Iterator[Setting]:
    """The settings of a section in order, `key` before the name of each.

    Args:
      default: of the section; None for that of its dataclass.
      source: of what differs in `default` from the defaults of the dataclass.
    """
    default = type(section)() if default is None else default
    for name, field in fields_of(type(section)).items():
        value, usual, said = getattr(section, name), getattr(default, name), field.metadata
        own = said["source"] if usual == field.default or isinstance(usual, dict) else source
        yield Setting(f"{key}.{name}", value, usual, said["says"], own)
        if dataclasses.is_dataclass(value):
            yield from listed(value, f"{key}.{name}", usual, said["source"])
