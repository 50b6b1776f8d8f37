"""Strict reading of YAML files whose top-level keys are sections, each described by a dataclass (`schema`).

The dataclass lives beside the code that uses it. Unknown, missing and repeated keys and wrong types are refused; ranges
are checked by the dataclass.
"""

import contextlib
import dataclasses
import re
import reprlib
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Literal, TypeVar, cast

import yaml

from ddf.core import checks, errors, provenance, schema

T = TypeVar("T")
CONFIGS = Path("configs")
PACKAGED = Path(__file__).resolve().parents[1] / "configs"  # of fits


_MOST_BYTES = 200_000  # of a file


class _Loader(yaml.SafeLoader):
    """YAML 1.2's numbers: 1e-4 is one, 010 is ten; 1:30, dates and `yes` are words. Refuses aliases,
    and keys that are given twice or are lists.
    """

    yaml_implicit_resolvers: ClassVar = {}  # pyright: ignore[reportIncompatibleVariableOverride]  (none of YAML 1.1)

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark
            raise yaml.constructor.ConstructorError(None, None, "write out what an alias names", mark)
        return super().compose_node(parent, index)

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


Layers = dict[str, list[tuple[str, Any]]]  # by section: where it is given and what, from the root of `base` on


def load(path: str | Path, name: str, cls: type[T]) -> T:
    """One section of a YAML file as an instance of its dataclass, see `resolve`; InputError where none gives it."""
    found = layers(path)
    if name not in found:
        raise checks.InputError(f"{path}: section {name!r} is missing")
    return resolve(found, name, cls)


def layers(path: str | Path) -> Layers:
    """What a file gives, and those that it builds on: `base: NAME` is a file beside it, in configs/ or of the package.
    InputError where there is none.
    """
    found: Layers = {}
    files: list[Path] = []
    file = Path(path)
    while True:
        given = read_yaml(file)
        if not isinstance(given, dict):
            raise checks.InputError(f"{file}: must hold sections of keys and values; got {type(given).__name__}")
        files.append(file)
        base = given.pop("base", None)
        for name, section in given.items():
            found.setdefault(str(name), []).insert(0, (f"{file}: {name}", {} if section is None else section))
        if base is None:
            return found
        below = named_file(str(base), file.parent)
        if below is None or below in files:
            raise checks.InputError(f"{file}: base: there is no other file {base!r} to build on")
        file = below


def named_file(name: str, beside: Path = CONFIGS) -> Path | None:
    """The file of a name: in a folder, in configs/, or of the package; None where there is none."""
    places = (folder / f"{name}.yaml" for folder in (beside, CONFIGS, PACKAGED))
    return next((place for place in places if place.is_file()), None)


def found_file(given: str | Path) -> Path:
    """The file of a path or a name; InputError where there is none, with the names that there are."""
    found = Path(given) if Path(given).is_file() else named_file(str(given))
    if found is None:
        names = ", ".join(sorted(path.stem for folder in (CONFIGS, PACKAGED) for path in folder.glob("*.yaml")))
        raise checks.InputError(f"{given}: no such file, nor the name of one; there are {names}")
    return found


def resolve(given: Layers, name: str, cls: type[T]) -> T:
    """A section: the defaults of its dataclass, and what each layer gives in place of them, the last one last.
    InputError names file and key of what does not fit.
    """
    found = cls()
    for where, section in given.get(name, ()):
        found = parse(section, cls, where, found)
    return found


def read_yaml(path: str | Path) -> Any:
    """What a YAML file of up to 200 kB holds."""
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


def recorded(data: Any, cls: type[T], where: str, needed: tuple[str, ...] = ()) -> T:
    """A section of a record, however old: keys that are gone are passed over, those that are not there have defaults.

    Args:
      needed: those that must be there.
    """
    return parse(data, cls, where, needed=needed)


def parse(data: Any, cls: type[T], where: str, onto: T | None = None, needed: tuple[str, ...] | None = None) -> T:
    """A plain dict as an instance of the dataclass `cls`; `where` names file and section in errors.

    Args:
      onto: gives what `data` does not, in parts too; None for the defaults of the dataclass.
      needed: see `recorded`; None of a file, whose keys must be settings.
    """
    if not isinstance(data, Mapping):
        raise checks.InputError(f"{where} must be a mapping of keys to values; got {_shown(data)}")
    fields = schema.fields_of(cls) if needed is None else {f.name: f for f in dataclasses.fields(cast(Any, cls))}
    if needed is None:
        errors.require_known(where, data, fields)
    hints, values = typing.get_type_hints(cls), dict[str, Any]()
    for name, field in fields.items():
        if name in data:
            part, inside = schema.part_of(hints[name]), f"{where}.{name}"
            if part is None or data[name] is None:
                values[name] = _convert(data[name], hints[name], inside)
            else:
                below = field.default if onto is None else getattr(onto, name)
                onto_part = below if needed is None and dataclasses.is_dataclass(below) else None
                values[name] = parse(data[name], part, inside, onto_part, None if needed is None else ())
        elif name in (needed or ()) or (onto is None and field.default is field.default_factory):  # both are missing
            raise checks.InputError(f"{where}: key {name!r} is missing")
    try:
        return cls(**values) if onto is None else dataclasses.replace(cast(Any, onto), **values)
    except ValueError as error:
        raise checks.InputError(f"{where}: {error}") from error


def plain(section: Any) -> dict[str, Any]:
    """What a file would give to make a section, its parts too, as YAML and JSON hold it."""
    given = {name: getattr(section, name) for name in schema.fields_of(type(section))}
    is_part = dataclasses.is_dataclass
    return {name: plain(each) if is_part(each) else provenance.plain(each) for name, each in given.items()}


_REPR = reprlib.Repr()
_REPR.maxlevel, _REPR.maxstring, _REPR.maxother, _REPR.maxlong = 3, 200, 200, 200
_shown = _REPR.repr  # a value in an error: the beginning of a long one


def _convert(value: Any, hint: Any, where: str) -> Any:
    """`value` as read from YAML, checked against (and, for tuples, floats and dataclasses, turned into) `hint`."""
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint is Any:
        return value
    if origin is Literal:
        if any(value == choice and type(value) is type(choice) for choice in arguments):
            return value
        raise checks.InputError(f"{where} must be one of {', '.join(map(str, arguments))}; got {_shown(value)}")
    if origin in (types.UnionType, typing.Union):
        return _convert_union(value, arguments, where)
    if origin in (tuple, list):
        return _convert_sequence(value, origin, arguments, where)
    if origin in (dict, Mapping):
        if not isinstance(value, dict):
            raise checks.InputError(f"{where} must be a mapping; got {_shown(value)}")
        key, item = arguments
        return {_convert(k, key, f"{where} (key)"): _convert(v, item, f"{where}.{k}") for k, v in value.items()}
    if dataclasses.is_dataclass(hint):
        return parse(value, cast(Any, hint), where)
    if hint is Path and isinstance(value, str):
        return Path(value)
    if hint is float and type(value) is int:
        return float(value)
    if type(value) is not hint:
        kind = getattr(hint, "__name__", str(hint))
        raise checks.InputError(f"{where} must be of type {kind}; got {_shown(value)}")
    if hint is float and not abs(value) < float("inf"):
        raise checks.InputError(f"{where} must be finite; got {value!r}")
    return value


def _convert_union(value: Any, choices: tuple[Any, ...], where: str) -> Any:
    if value is None and type(None) in choices:
        return None
    others = [choice for choice in choices if choice is not type(None)]
    for choice in others[:-1]:
        with contextlib.suppress(checks.InputError):
            return _convert(value, choice, where)
    return _convert(value, others[-1], where)


def _convert_sequence(value: Any, origin: Any, arguments: tuple[Any, ...], where: str) -> Any:
    if not isinstance(value, list):
        raise checks.InputError(f"{where} must be a list; got {_shown(value)}")
    hints = arguments if origin is tuple and Ellipsis not in arguments else arguments[:1] * len(value)
    if len(value) != len(hints):
        raise checks.InputError(f"{where} must have {len(hints)} entries; got {len(value)}")
    return origin(
        _convert(item, hint, f"{where}[{i}]") for i, (item, hint) in enumerate(zip(value, hints, strict=True))
    )
