"""A command is a declared function: its signature and docstring make the parser, the help and docs/commands.md.

A parameter is an argument by its place, one behind `*` an option of its name; `Arg` says what the type does not. The
text of an argument is its line under `Args:`, that of its `Arg`, or that of the function of `ddf.api` it stands for.
"""

import argparse
import ast
import inspect
import re
import types
import typing
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, NamedTuple

_API = Path(__file__).resolve().parents[1] / "api"
_HEADINGS = ("Args:", "Returns:", "Raises:", "Example:", "Examples:")


@dataclass(frozen=True)
class Arg:
    """What the type of a parameter does not say about its argument.

    flags: of an option, in place of its name. parse: from text, in place of the type. like: its name in `ddf.api`.
    reads: kinds of models that it may name. writes: what is written there. group: of options that exclude each other.
    undeclared: another argument sets it.
    """

    metavar: str | None = None
    flags: tuple[str, ...] = ()
    parse: Callable[[str], Any] | None = None
    help: str = ""
    like: str = ""
    reads: tuple[str, ...] = ()
    writes: Literal["", "file", "folder"] = ""
    group: str = ""
    action: Any = None
    nargs: str | None = None
    undeclared: bool = False


class Parameter(NamedTuple):
    """A parameter of a command: its name, type and default, whether it is an option, and its `Arg`."""

    name: str
    kind: Any
    default: Any
    is_option: bool
    arg: Arg


class Docstring(NamedTuple):
    """The text of a docstring, the text of each argument, and the lines of the examples."""

    text: str
    arguments: dict[str, str]
    examples: list[str]


@dataclass
class Command:
    """A function as a command of `ddf`.

    room: its heading in the help. api: `module:function` of `ddf.api` that it calls. kept: what is left when it is
    interrupted. actions: words that may follow it, such as `get`, each a command too.
    """

    run: Callable[..., dict[str, Any]]
    name: str
    room: str
    api: str = ""
    kept: str = ""
    actions_metavar: str = ""
    actions: "dict[str, Command]" = field(default_factory=dict)

    @cached_property
    def docstring(self) -> Docstring:
        """Its docstring in parts."""
        return parsed(self.run.__doc__ or "")

    @property
    def summary(self) -> str:
        """The first line of its docstring, without the full stop."""
        return self.docstring.text.partition("\n")[0].removesuffix(".")

    @cached_property
    def parameters(self) -> list[Parameter]:
        """What it is called with."""
        return [_parameter(each) for each in inspect.signature(self.run).parameters.values()]

    def action(self, name: str) -> "Callable[[Callable[..., dict[str, Any]]], Command]":
        """Declare a function as a word that may follow the command."""

        def declare(run: Callable[..., dict[str, Any]]) -> Command:
            self.actions[name] = Command(run, name, room="")
            return self.actions[name]

        return declare

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the arguments of the command to a parser."""
        api = _of_api(self.api) if self.api else {}
        groups: dict[str, Any] = {"": parser}
        for each in self.parameters:
            if each.arg.group not in groups:
                groups[each.arg.group] = parser.add_mutually_exclusive_group()
            if not each.arg.undeclared:
                text = self.docstring.arguments.get(each.name) or each.arg.help
                _add(groups[each.arg.group], each, text or api.get(each.arg.like or each.name, ""))
            if each.arg.writes == "file":
                text = "make the folder of the output where it is missing"
                parser.add_argument("--make-folders", action="store_true", help=text)
        if self.docstring.examples:
            parser.epilog = "\n".join(("examples:", *(f"  {line}" for line in self.docstring.examples)))
        if self.actions:
            actions = parser.add_subparsers(dest="action", metavar=self.actions_metavar, required=False)
            for name, action in self.actions.items():
                inner = actions.add_parser(name, help=action.summary, description=action.docstring.text)
                action.add_arguments(inner)
                add_json(inner, default=argparse.SUPPRESS)

    def called(self, args: argparse.Namespace) -> "Command":
        """The command itself, or the action that was asked for."""
        return self.actions.get(getattr(args, "action", None) or "", self)

    def call(self, args: argparse.Namespace) -> dict[str, Any]:
        """The result of the command with parsed arguments."""
        return self.run(**{each.name: getattr(args, each.name) for each in self.parameters})


def command(
    room: str, *, api: str = "", kept: str = "", actions: str = ""
) -> Callable[[Callable[..., dict[str, Any]]], Command]:
    """Declare a function as a command of its name."""
    return lambda run: Command(run, run.__name__, room, api, kept, actions)


def found_in(module: types.ModuleType) -> Iterator[Command]:
    """The commands that a module declares, in its order."""
    return (each for each in vars(module).values() if isinstance(each, Command) and each.room)


def add_json(parser: argparse.ArgumentParser, **how: Any) -> None:
    """The option that every command has."""
    parser.add_argument("--json", action="store_true", help="print one JSON object on stdout, for scripts", **how)


def parsed(docstring: str) -> Docstring:
    """A docstring in parts: `Args:` and `Examples:` are indented below their headings."""
    parts: dict[str, list[str]] = {"": []}
    heading = ""
    for line in inspect.cleandoc(docstring).splitlines():
        if line in _HEADINGS:
            heading = line
        parts.setdefault(heading, []).append(line)
    arguments: dict[str, str] = {}
    name = ""
    for line in parts.get("Args:", [])[1:]:
        entry = re.match(r"  (\w+): (.*)", line)
        name, text = entry.groups() if entry else (name, f"{arguments.get(name, '')} {line.strip()}")
        arguments[name] = text
    said = {key: text.strip().removesuffix(".") for key, text in arguments.items()}
    return Docstring("\n".join(parts[""]).strip(), said, [line.strip() for line in parts.get("Examples:", [])[1:]])


def _of_api(place: str) -> dict[str, str]:
    """Texts of the arguments of `module:function` of `ddf.api`, which is read, not imported: that takes long."""
    module, _, function = place.partition(":")
    for node in ast.walk(ast.parse((_API / f"{module}.py").read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef) and node.name == function and (docstring := ast.get_docstring(node)):
            return parsed(docstring).arguments
    raise LookupError(f"ddf.api has no {place}")


def _parameter(parameter: inspect.Parameter) -> Parameter:
    kind, arg = parameter.annotation, Arg()
    while typing.get_origin(kind) in (typing.Annotated, typing.Union, types.UnionType):
        inside = typing.get_args(kind)
        if typing.get_origin(kind) is typing.Annotated:
            arg = inside[1]
        kind = inside[0]
    return Parameter(parameter.name, kind, parameter.default, parameter.kind is parameter.KEYWORD_ONLY, arg)


def _add(parser: Any, parameter: Parameter, text: str) -> None:
    name, kind, default, is_option, arg = parameter
    is_required = default is inspect.Parameter.empty
    if not (is_required or default is None or default is False or default in ("", [], ()) or "default" in text):
        value = ",".join(default) if type(default) is tuple else f"{default:g}" if type(default) is float else default
        text = f"{text} (default {value})"
    if arg.writes == "folder":
        text = f"folder, made if needed; {text}"
    how: dict[str, Any] = {"help": text.strip().replace("%", "%%")}
    if not is_required:
        how["default"] = default
    if kind is bool:
        how["action"] = "store_true"
    else:
        how["nargs"] = arg.nargs
        if typing.get_origin(kind) is list:
            (kind,) = typing.get_args(kind)
            how["nargs"] = None if arg.action == "append" else arg.nargs or "+"
        if typing.get_origin(kind) is Literal:
            how["choices"] = typing.get_args(kind)
            kind = type(how["choices"][0])
        how |= {"type": arg.parse or kind, "metavar": arg.metavar, "action": arg.action or "store"}
    if is_option:
        flags = arg.flags or (f"--{name.replace('_', '-')}",)
        parser.add_argument(*flags, dest=name, required=is_required, **how)
    else:
        parser.add_argument(name, **how)
