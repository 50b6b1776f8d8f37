"""The frame of every command: arguments, help, results as a table or as JSON, errors in one line.

Commands are the functions that modules beside this one declare, by `declare.command`. What such a module imports at its
top is what bare help waits for: what takes long to load belongs inside the functions. A command returns its result, one
JSON object with --json, to which the frame adds what it wrote. Three keys are not in it: `table` (label to value, shown
instead of the rest), `verdict` (one line, shown last) and `doubtful` (done, but not to be relied on).

Exit code 0; 1 where what was done is doubtful; 2 after one line on stderr when the input is at fault; 130 or 143 when
SIGINT or SIGTERM ended it, after a line that says what is kept.
"""

import argparse
import contextlib
import importlib
import importlib.util
import io
import os
import re
import shlex
import shutil
import signal
import sys
import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

from ddf.cli import arguments, declare, doctor, experiments, fields, meshes, models, results, shapes, views
from ddf.core import errors, extras, processes

ROOMS = {"mesh": "meshes and clouds", "field": "fields", "model": "trained models", "experiment": "experiments"}
IN_A_CHECKOUT = ("run", "info")  # those that `ddf_lab` brings
_MODULES = [meshes, shapes, fields, views, models, experiments, doctor]
if importlib.util.find_spec("ddf_lab"):
    _MODULES.append(importlib.import_module("ddf_lab.commands"))
COMMANDS: dict[str, declare.Command] = {each.name: each for module in _MODULES for each in declare.found_in(module)}
_NEGATIVE = re.compile(r"-(\.?\d|[xyz]$)")  # how a negative value, or an axis, begins; no option does
_CHOICE = re.compile(r"invalid choice: '(.*?)' \(choose from (.*)\)")  # as argparse has it


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; bare `ddf` prints the help."""
    argv = with_negative_values(sys.argv[1:] if argv is None else argv)
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:  # closed, as services have it: the next file opened would get its number
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), "w" if number else "r"))
    for stream in (sys.stdout, sys.stderr):  # a name or sign that the terminal cannot show is escaped
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # threads that wait by spinning stall a busy machine
    if "_ARGCOMPLETE" in os.environ:
        _complete()
    chosen = next((word for word in argv if not word.startswith("-")), None)
    if chosen in IN_A_CHECKOUT and chosen not in COMMANDS:
        sys.stderr.write(f"ddf {chosen}: error: experiments need a checkout of the repository: `make setup` in it\n")
        return 2
    if argv[:1] == ["--version"]:
        sys.stdout.write(f"ddf {extras.version()}\n")
        return 0
    parser = _parser(chosen)
    if not argv:
        parser.print_help()
        return 0
    args = parser.parse_args(argv)
    doubts = list[bool]()
    with processes.raised():
        return processes.guarded(lambda: doubts.append(_run(args, argv)), f"ddf {args.command}") or sum(doubts)


def with_negative_values(argv: Sequence[str]) -> list[str]:
    """Options joined with values that begin with a minus: argparse takes `-30,10` behind `--camera` for an option."""
    joined: list[str] = []
    for word in argv:
        before = joined[-1] if joined else ""
        if _NEGATIVE.match(word) and before.startswith("-") and before != "--" and "=" not in before:
            joined[-1] = f"{before}={word}" if before.startswith("--") else before + word
        else:
            joined.append(word)
    return joined


def _run(args: argparse.Namespace, words: Sequence[str]) -> bool:
    """Call the command and print its result; whether that is doubtful."""
    command = COMMANDS[args.command].called(args)
    with _stdout_to_stderr() if args.json else contextlib.nullcontext():
        arguments.require_places(command, args)
        try:
            result = command.call(args)
            out, _ = arguments.written(command, args)
            result = result if out is None else {"out": out.as_posix()} | result
        except MemoryError as error:
            raise errors.InputError(f"not enough memory: {error or 'the input is too large'}") from error
        except KeyboardInterrupt as stop:
            kept = getattr(stop, "kept", "") or arguments.kept(command, args)
            if kept.endswith(":"):
                kept += f" ddf {shlex.join(words)}"
            raise processes.Interrupted(getattr(stop, "number", signal.SIGINT), kept) from stop
    sys.stdout.write(results.json_line(result) if args.json else results.text(result))
    sys.stdout.flush()
    return bool(result.get("doubtful"))


class _Parser(argparse.ArgumentParser):
    """argparse with errors in one line, which ask whether the nearest known word was meant."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:  # pyright: ignore[reportIncompatibleMethodOverride]
        """As argparse, but a command tells of its own options that it does not know."""
        found, left = super().parse_known_args(args, namespace)
        wrong = next((word.partition("=")[0] for word in left if word.startswith("-")), None)
        if wrong is not None:
            options = [name for action in self._actions for name in action.option_strings]
            self.error(
                f"unrecognized arguments: {' '.join(left)}; the options are {errors.known_names(wrong, options)}"
            )
        return found, left

    def error(self, message: str) -> Any:
        choice = _CHOICE.search(message)
        if choice:
            there = errors.known_names(choice[1], re.findall(r"[\w.-]+", choice[2]))
            message = message.replace(choice[0], f"invalid choice: {choice[1]!r}; there are {there}")
        self.exit(2, f"{self.prog}: error: {' '.join(message.split())} (see {self.prog} --help)\n")


def _parser(chosen: str | None) -> _Parser:
    """The parser of all commands; the arguments of the chosen one alone are declared, for that takes time."""
    shape: dict[str, Any] = {"formatter_class": argparse.RawDescriptionHelpFormatter}
    description = "Directed distance fields: oriented points in, visibility and depth out."
    parser = _Parser(prog="ddf", usage="ddf COMMAND ...", description=description, epilog=_listing(), **shape)
    parser.add_argument("--version", action="store_true", help="print the version and leave")
    commands = parser.add_subparsers(prog="ddf", dest="command", required=True, metavar="COMMAND", parser_class=_Parser)
    for name, command in COMMANDS.items():
        added = commands.add_parser(name, description=command.docstring.text if name == chosen else "", **shape)
        declare.add_json(added)
        if name == chosen:
            command.add_arguments(added)
    return parser


def _listing() -> str:
    """Every command with its summary, by room."""
    lines, width = [], max(40, shutil.get_terminal_size().columns - 2)  # as argparse wraps the rest
    for room, title in ROOMS.items():
        lines.append(f"{title}:")
        for name, command in COMMANDS.items():
            if command.room == room:
                lines += textwrap.wrap(
                    command.summary, width, initial_indent=f"  {name:<12} ", subsequent_indent=" " * 15
                )
    lines += ["", "ddf COMMAND --help tells its arguments, with examples."]
    return "\n".join([*lines, 'Completion in bash and zsh: eval "$(register-python-argcomplete ddf)"'])


def _complete() -> None:
    """Answer the shell that asks how a line may go on, and leave."""
    import argcomplete

    words = os.environ.get("COMP_LINE", "").split()
    argcomplete.autocomplete(_parser(next((word for word in words if word in COMMANDS), None)))


@contextlib.contextmanager
def _stdout_to_stderr() -> Iterator[None]:
    """Send what libraries print on stdout, from native code too, to stderr, so that --json prints JSON alone."""
    sys.stdout.flush()
    saved = os.dup(1)
    try:
        os.dup2(2, 1)
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        sys.stdout.flush()
        os.dup2(saved, 1)
        os.close(saved)
