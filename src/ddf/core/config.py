"""Strict reading of YAML files whose top-level keys are sections, each described by a dataclass.

The dataclass lives beside the code that uses it. Unknown, missing and repeated keys and wrong types are refused; ranges
are checked by the dataclass.
"""

import dataclasses
import functools
import re
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Literal, TypeVar

import yaml

from ddf.core import checks, names

T = TypeVar("T")


_MOST_BYTES, _MOST_NODES = 200_000, 20_000  # of a file; what aliases name counts as often as they name it


class _Loader(yaml.SafeLoader):
    """YAML 1.2's numbers, as DVC reads them: 1e-4 is one, 010 is ten; 1:30, dates and `yes` are words. Refuses keys
    that are given twice or are lists, and aliases of aliases that would fill the memory.
    """

    yaml_implicit_resolvers: ClassVar = {}  # pyright: ignore[reportIncompatibleVariableOverride]  (none of YAML 1.1)

    def get_single_node(self) -> yaml.Node | None:
        node = super().get_single_node()
        if node is not None and _size(node, {}) > _MOST_NODES:
            raise yaml.constructor.ConstructorError(None, None, f"more than {_MOST_NODES:,} entries", node.start_mark)
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[Any] = set()
        for key_node, _ in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                raise yaml.constructor.ConstructorError(None, None, "a key must be one word", key_node.start_mark)
            key = self.construct_object(key_node, deep=True)
            if key in seen:
                raise yaml.constructor.ConstructorError(None, None, f"key {key!r} is given twice", key_node.start_mark)
            seen.add(key)
        return super().construct_mapping(node, deep)


def _size(node: yaml.Node, known: dict[int, int]) -> int:
    """Nodes below and with this one, with every alias followed."""
    if known.setdefault(id(node), 0) == 0:
        known[id(node)] = -1
        parts = node.value if isinstance(node, yaml.SequenceNode) else []
        if isinstance(node, yaml.MappingNode):
            parts = [part for pair in node.value for part in pair]
        known[id(node)] = 1 + sum(_size(part, known) for part in parts)
    if known[id(node)] < 0:
        raise yaml.constructor.ConstructorError(None, None, "an alias stands in what it names", node.start_mark)
    return known[id(node)]


def _whole(loader: _Loader, node: yaml.ScalarNode) -> int:
    text = loader.construct_scalar(node)
    value = int(text, {"0o": 8, "0x": 16}.get(text[:2], 10))
    if abs(value) >= 1 << 63:
        raise yaml.constructor.ConstructorError(None, None, "a whole number of over 64 bits", node.start_mark)
    return value


def _real(loader: _Loader, node: yaml.ScalarNode) -> float:
    return float(re.sub(r"\.(?=inf|nan)", "", loader.construct_scalar(node).lower()))


for _tag, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?\d+|0o[0-7]+|0x[\da-fA-F]+", list("-+0123456789")),
    ("float", r"[-+]?(\.\d+|\d+(\.\d*)?)([eE][-+]?\d+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)", list("-+.0123456789")),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(f"(?:{_pattern})\\Z", re.ASCII), _first)
_Loader.add_constructor("tag:yaml.org,2002:int", _whole)
_Loader.add_constructor("tag:yaml.org,2002:float", _real)


def load(path: str | Path, name: str, cls: type[T]) -> T:
    """One section of a YAML file, by its name, as an instance of the dataclass that describes it.

    Args:
      cls: every field without a default must be given, every given key must be a field.
    Raises:
      InputError: naming the file and the key, for anything that does not fit.
    """
    sections = read(path)
    if name not in sections:
        raise checks.InputError(f"{path}: section {name!r} is missing")
    return parse(sections[name], cls, f"{path}: {name}")


def read(path: str | Path) -> dict[str, Any]:
    """All sections of a file as plain dicts."""
    data = read_yaml(path)
    if not isinstance(data, dict):
        raise checks.InputError(f"{path}: must hold sections of keys and values; got {type(data).__name__}")
    return data


def read_yaml(path: str | Path) -> Any:
    """What a YAML file of up to 200 kB holds.

    Raises:
      FileNotFoundError: there is no such file. InputError: it is too large, no text, or no YAML; it is named.
    """
    checks.require_content(path)
    try:
        with Path(path).open("rb") as file:
            text = file.read(_MOST_BYTES + 1)
        if len(text) > _MOST_BYTES:
            raise checks.InputError(f"{path}: more than {_MOST_BYTES:,} bytes; is this the YAML file?")
        return parse_value(text.decode("utf-8-sig"), str(path))
    except UnicodeDecodeError as error:
        raise checks.InputError(f"{path}: not a UTF-8 text file") from error


def parse_value(text: str, where: str) -> Any:
    """One value as it would stand in an experiment file; `where` names it in errors."""
    try:  # CSafeLoader is faster, but does not run the checks above; the files have about a hundred lines.
        return yaml.load(text, Loader=_Loader)
    except RecursionError as error:
        raise checks.InputError(f"{where}: not valid YAML: lists within lists, too deep") from error
    except (yaml.YAMLError, ValueError, TypeError, OverflowError, AttributeError, KeyError) as error:
        raise checks.InputError(f"{where}: not valid YAML: {' '.join(str(error).split())}") from error


def parse(data: Any, cls: type[T], where: str) -> T:
    """A plain dict as an instance of the dataclass `cls`; `where` names file and section in errors."""
    if not isinstance(data, Mapping):
        raise checks.InputError(f"{where} must be a mapping of keys to values; got {data!r}")
    hints = _hints(cls)
    fields = {field.name: field for field in dataclasses.fields(typing.cast(Any, cls))}
    unknown = [str(key) for key in data if key not in fields]
    if unknown:
        raise checks.InputError(f"{where}: unknown key {unknown[0]!r}; the keys are {names.known(unknown[0], fields)}")
    missing = [name for name, field in fields.items() if name not in data and _is_required(field)]
    if missing:
        raise checks.InputError(f"{where}: key {missing[0]!r} is missing")
    values = {name: _convert(value, hints[name], f"{where}.{name}") for name, value in data.items()}
    try:
        return cls(**values)
    except ValueError as error:
        file, _, section = where.rpartition(": ")
        own_name = str(error).startswith(f"{section}.")  # range checks may name section and key themselves
        raise checks.InputError(f"{file if own_name else where}: {error}") from error


def known(data: Any, cls: type) -> Any:
    """A section of an older record without the keys that its dataclass `cls` no longer has, however deep."""
    if not isinstance(data, Mapping):
        return data
    hints, kept = _hints(cls), {}
    for name, value in data.items():
        if name in hints:
            inner = [hint for hint in (hints[name], *typing.get_args(hints[name])) if dataclasses.is_dataclass(hint)]
            kept[name] = known(value, typing.cast(type, inner[0])) if inner else value
    return kept


@functools.cache
def _hints(cls: type) -> dict[str, Any]:
    return typing.get_type_hints(cls)


def _is_required(field: dataclasses.Field[Any]) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def _convert(value: Any, hint: Any, where: str) -> Any:
    """`value` as read from YAML, checked against (and, for tuples, floats and dataclasses, turned into) `hint`."""
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint is Any:
        return value
    if origin is Literal:
        if any(value == choice and type(value) is type(choice) for choice in arguments):
            return value
        raise checks.InputError(f"{where} must be one of {', '.join(map(str, arguments))}; got {value!r}")
    if origin in (types.UnionType, typing.Union):
        return _convert_union(value, arguments, where)
    if origin in (tuple, list):
        return _convert_sequence(value, origin, arguments, where)
    if origin in (dict, Mapping):
        if not isinstance(value, dict):
            raise checks.InputError(f"{where} must be a mapping; got {value!r}")
        return {
            _convert(key, arguments[0], f"{where} (key)"): _convert(item, arguments[1], f"{where}.{key}")
            for key, item in value.items()
        }
    if dataclasses.is_dataclass(hint):
        return parse(value, typing.cast(Any, hint), where)
    return _convert_scalar(value, hint, where)


def _convert_union(value: Any, choices: tuple[Any, ...], where: str) -> Any:
    if value is None and type(None) in choices:
        return None
    others = [choice for choice in choices if choice is not type(None)]
    for choice in others[:-1]:
        try:
            return _convert(value, choice, where)
        except checks.InputError:
            continue
    return _convert(value, others[-1], where)


def _convert_sequence(value: Any, origin: Any, arguments: tuple[Any, ...], where: str) -> Any:
    if not isinstance(value, list):
        raise checks.InputError(f"{where} must be a list; got {value!r}")
    if origin is tuple and not (len(arguments) == 2 and arguments[1] is Ellipsis):
        if len(value) != len(arguments):
            raise checks.InputError(f"{where} must have {len(arguments)} entries; got {len(value)}")
        hints = arguments
    else:
        hints = (arguments[0],) * len(value)
    return origin(
        _convert(item, hint, f"{where}[{i}]") for i, (item, hint) in enumerate(zip(value, hints, strict=True))
    )


def _convert_scalar(value: Any, hint: Any, where: str) -> Any:
    if hint is Path and isinstance(value, str):
        return Path(value)
    if hint is float and type(value) is int:
        return float(value)
    if type(value) is not hint:
        kind = getattr(hint, "__name__", str(hint))
        raise checks.InputError(f"{where} must be of type {kind}; got {value!r}")
    if hint is float and not abs(value) < float("inf"):
        raise checks.InputError(f"{where} must be finite; got {value!r}")
    return value
