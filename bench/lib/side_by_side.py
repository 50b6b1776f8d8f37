"""Fits that run side by side, each in a process of its own: a benchmark that calls itself for every one of them."""

import argparse
import dataclasses
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from concurrent import futures
from pathlib import Path
from typing import Any

from bench.lib import measuring
from ddf.core import checks, storage
from ddf.fit import fit_settings


def add_options(parser: argparse.ArgumentParser, all_at_once: int | None = None) -> None:
    """`--side-by-side N` and `--threads T`.

    Args:
      all_at_once: what N is where the option is given without it; None: N must be given.
    """
    told = "fits at a time, each in a process of its own (default: 1)"
    option = parser.add_argument("--side-by-side", type=int, default=1, metavar="N", help=told)
    if all_at_once is not None:
        option.nargs, option.const = "?", all_at_once
    parser.add_argument(
        "--threads", type=int, help="of each fit (default: those of its config; side by side its share of the cores)"
    )


def add_rows(parser: argparse.ArgumentParser, known: Iterable[str]) -> None:
    """`--only NAME ...`, and the file for the row of one name that `rows` gives; `deliver` heeds both."""
    parser.add_argument("--only", nargs="+", choices=list(known), help="these alone; prints instead of writing")
    parser.add_argument("--row", type=Path, help=argparse.SUPPRESS)


def threads(arguments: argparse.Namespace, own: int) -> int:
    """Of each fit: as asked for; side by side an equal share of the cores, 1 at least; else its config's `own`.

    Raises:
      InputError: one of the options is less than 1.
    """
    for name in ("side_by_side", "threads"):
        value = getattr(arguments, name)
        if value is not None and value < 1:
            raise checks.InputError(f"--{name.replace('_', '-')} must be >= 1; got {value}")
    share = max(1, (os.cpu_count() or 1) // arguments.side_by_side)
    return arguments.threads or (own if arguments.side_by_side == 1 else share)


def budgeted(section: fit_settings.FitConfig, minutes: float | None, count: int) -> fit_settings.FitConfig:
    """The same fit for so many minutes, and with so many threads."""
    loop = dataclasses.replace(section.loop, threads=count)
    return dataclasses.replace(section, steps=None, minutes=minutes, loop=loop)


def command(benchmark: str, *arguments: str) -> list[str]:
    """Arguments of a Python that runs a benchmark."""
    return ["-m", "bench", benchmark, *arguments]


def rows(benchmark: str, names: Sequence[str], given: Sequence[str], at_once: int) -> list[dict[str, Any]]:
    """What a benchmark writes for each name, called with `--only <name> --row <file>` in a process of its own.

    Args:
      given: further arguments of every call.
    Raises:
      InputError: some calls failed; named.
    """
    with tempfile.TemporaryDirectory() as folder:
        files = {name: Path(folder) / f"{place}.json" for place, name in enumerate(names)}
        commands = {
            name: command(benchmark, "--only", name, *given, "--row", str(file)) for name, file in files.items()
        }
        if failed := run(commands, at_once):
            raise checks.InputError(f"not fitted: {'; '.join(failed)}")
        return [storage.read_json(file) for file in files.values()]


def deliver(benchmark: str, arguments: argparse.Namespace, count: int, found: Sequence[Mapping[str, Any]]) -> None:
    """Rows to where the benchmark was told: one to its file, some to the screen alone, all to `reports/bench` too.

    Args:
      count: threads of each fit.
    """
    if arguments.row:
        storage.write_json(arguments.row, found[0])
        return
    for row in found:
        print(
            row["what"],
            f"{row['steps']:,} steps",
            {key: value and round(value, 4) for key, value in row["error"].items()},
        )
    if not arguments.only:
        measuring.write(benchmark, count, found)


def run(commands: Mapping[str, Sequence[str]], at_once: int) -> list[str]:
    """Run Python with each of the arguments, `at_once` at a time; the names of those that failed, in order."""

    def failed(arguments: Sequence[str]) -> bool:
        return subprocess.run([sys.executable, *arguments]).returncode != 0

    with futures.ThreadPoolExecutor(at_once) as pool:
        return [name for name, bad in zip(commands, pool.map(failed, commands.values()), strict=True) if bad]
