"""`python -m bench` lists the benchmarks; `python -m bench NAME [options]` runs one.

`run [NAME or GROUP ...] [-- options]` runs several, each in a process of its own (without names: those of `make
bench`), and writes their page; `check` runs them into a folder of its own and compares with reports/bench. `page`
writes reports/bench/README.md alone, `fit_page` reports/fit_proof/README.md; `compare FIRST_DIR SECOND_DIR` compares
two runs.
`DDF_BENCH_OUT` names another folder than reports/bench.
"""

import argparse
import importlib
import inspect
import itertools
import os
import shutil
import subprocess
import sys
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path

from bench.lib import catalogue, compare, measuring
from ddf.core import guard

MODULES = {"page": "bench.lib.page", "fit_page": "bench.fits.fit_page", "compare": "bench.lib.compare"}
CHECKED = Path(".make/bench").resolve()  # results of `check`
WIDTH, INDENT = 110, 20  # of the listing


def listing() -> str:
    """Every benchmark by group, with what it measures."""
    known = sorted(catalogue.entries().values(), key=lambda entry: entry.group)
    lines = [(__doc__ or "").strip()]
    for group, members in itertools.groupby(known, lambda entry: entry.group):
        lines.append(f"\n{group or 'everything'}")
        for entry in members:
            about = f"[{entry.on_demand}] {entry.about}" if entry.on_demand else entry.about
            words = textwrap.fill(about, WIDTH - INDENT, max_lines=2, placeholder=" ...")
            lines.append(textwrap.indent(words, " " * INDENT).replace(" " * INDENT, f"  {entry.name:{INDENT - 2}}", 1))
    return "\n".join(lines)


def run_several(arguments: Sequence[str]) -> int:
    """Each in a process of its own, then the pages that they are on; those that failed are named, and 1 returned."""
    names, options = _split(arguments)
    chosen = catalogue.chosen(names)
    pages = dict.fromkeys("fit_page" if entry.group == "fits" else "page" for entry in chosen)
    return _run([[entry.name, *options] for entry in chosen] + [[page] for page in pages])


def check(arguments: Sequence[str]) -> int:
    """As `run_several`, into `CHECKED` and without pages, then compared with what was there; 1 for faults."""
    names, options = _split(arguments)
    chosen = catalogue.chosen(names)
    shutil.rmtree(CHECKED, ignore_errors=True)
    failed = _run([[entry.name, *options] for entry in chosen], {"DDF_BENCH_OUT": str(CHECKED)})
    return compare.run([str(measuring.OUT), str(CHECKED)]) or failed


def _split(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Names, and what follows `--`."""
    names = list(itertools.takewhile(lambda word: word != "--", arguments))
    return names, list(arguments[len(names) + 1 :])


def _run(calls: Sequence[Sequence[str]], environment: Mapping[str, str] | None = None) -> int:
    """This program once with each of the arguments; 1 where one failed."""
    known = os.environ | (environment or {})
    failed = [c[0] for c in calls if subprocess.run([sys.executable, "-m", "bench", *c], env=known).returncode]
    if failed:
        sys.stderr.write(f"failed: {', '.join(failed)}\n")
    return 1 if failed else 0


def run_one(name: str, arguments: Sequence[str]) -> int:
    """One benchmark in this process; one whose `main` takes no arguments has no options."""
    module = importlib.import_module(catalogue.find(name).module)
    if inspect.signature(module.main).parameters:
        module.main(arguments)
    else:
        argparse.ArgumentParser(f"python -m bench {name}", description=module.__doc__).parse_args(arguments)
        module.main()
    return 0


COMMANDS = {"run": run_several, "check": check}


def main(arguments: Sequence[str]) -> int:
    """What the first argument names; the exit code."""
    if not arguments or arguments[0] in ("-h", "--help"):
        print(listing())
        return 0
    name, *rest = arguments
    if name in COMMANDS:
        return COMMANDS[name](rest)
    if name in MODULES:
        return importlib.import_module(MODULES[name]).run(rest)
    return run_one(name, rest)


if __name__ == "__main__":
    codes: list[int] = []
    failed = guard.guarded(lambda: codes.append(main(sys.argv[1:])), "bench")
    raise SystemExit(failed or codes[0])
