"""`python -m bench` lists the benchmarks; `python -m bench NAME [options]` runs one.

`run NAME ...` runs several, each in a process of its own, and writes their page; `page` writes the page alone.
`DDF_BENCH_OUT` names another folder than reports/bench.
"""

import argparse
import importlib
import subprocess
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path

from bench.lib import catalogue, measuring
from ddf.cli import declare
from ddf.core import processes
from ddf_lab.engine import publish

WIDTH, INDENT = 110, 20  # of the listing


def listing() -> str:
    """Every benchmark, with what it measures."""
    lines = [(__doc__ or "").strip(), ""]
    for entry in catalogue.entries().values():
        words = textwrap.fill(entry.about[0], WIDTH - INDENT, max_lines=2, placeholder=" ...")
        lines.append(textwrap.indent(words, " " * INDENT).replace(" " * INDENT, f"  {entry.name:{INDENT - 2}}", 1))
    return "\n".join(lines)


def run_several(names: Sequence[str]) -> int:
    """Each in a process of its own, then their page; those that failed are named, and 1 returned."""
    calls = [*(entry.name for entry in catalogue.chosen(names)), "page"]
    failed = [name for name in calls if subprocess.run([sys.executable, "-m", "bench", name]).returncode]
    if failed:
        sys.stderr.write(f"failed: {', '.join(failed)}\n")
    return 1 if failed else 0


def run_one(name: str, arguments: Sequence[str]) -> int:
    """The rows of a benchmark's `main`, whose signature and docstring are its options, made and written."""
    (entry,) = catalogue.chosen([name])
    module = importlib.import_module(entry.module)
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(f"python -m bench {name}", description=module.__doc__, formatter_class=raw)
    declare.Command(module.main, name, room="").add_arguments(parser)
    options, threads = vars(parser.parse_args(arguments)), getattr(module, "THREADS", 1)
    importlib.import_module("torch").set_num_threads(threads)
    if rows := module.main(**options):
        code = publish.of_bench(Path(module.__file__ or ""))
        measuring.write(name, threads, rows, getattr(module, "KEPT", False), code)
    return 0


def main(arguments: Sequence[str]) -> int:
    """What the first argument names; the exit code."""
    if list(arguments) in ([], ["run"]) or arguments[0] in ("-h", "--help"):
        print(listing())
        return 0
    name, *rest = arguments
    if name == "page":
        return importlib.import_module("bench.lib.page").run()  # heavy
    return run_several(rest) if name == "run" else run_one(name, rest)


if __name__ == "__main__":
    codes: list[int] = []
    failed = processes.guarded(lambda: codes.append(main(sys.argv[1:])), "bench")
    raise SystemExit(failed or codes[0])
