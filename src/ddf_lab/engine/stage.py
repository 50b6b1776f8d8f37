"""The frame around a stage script: arguments, log, and errors of the user as one line and exit code 2."""

import argparse
import contextlib
import dataclasses
import logging
import os
import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

from ddf.core import guard, interrupts, locks, notes
from ddf_lab.engine import finished
from ddf_lab.run import Run, time_path

Make = Callable[[Run], None]


def main(category: bool = False, seed: bool = False) -> Callable[[Make], Make]:
    """Of a script's last function: called with the run of `--config FILE [--category NAME] [--seed S]` where the script
    is run, left as it is where it is imported.

    InputError and OSError (no such file, disk full, read-only) end the process with one line on stderr and code 2;
    anything else is a bug and keeps its traceback.
    """

    def called(make: Make) -> Make:
        if make.__module__ == "__main__":
            _start(make, category, seed)
        return make

    return called


def _start(make: Make, category: bool, seed: bool) -> NoReturn:
    parser = argparse.ArgumentParser(description=(sys.modules["__main__"].__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--config", type=Path, required=True, dest="file", help="experiment file, for example configs/cpu.yaml"
    )
    if category:
        parser.add_argument("--category", required=True, help="one of the categories of the experiment")
    if seed:
        parser.add_argument("--seed", type=_whole_number, default=0, help="added to the config's seeds (default 0)")
    arguments = vars(parser.parse_args())
    logging.basicConfig(level=logging.INFO, format="%(message)s", stream=sys.stderr)
    kept = "what is finished is kept, and the same command goes on from there"
    with interrupts.raised():
        sys.exit(guard.guarded(lambda: _run_alone(make, Run.read(**arguments)), Path(sys.argv[0]).stem, kept))


def _whole_number(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"must be a whole number, 0 or more; got {text!r}")
    return int(text)


def _run_alone(make: Make, run: Run) -> None:
    """Run while holding the stage's lock, then note time, memory and what was made of what.

    Where the note of an earlier run says that there is nothing to do, nothing is done. A killed engine can leave a
    stage's process behind that still writes the same files. The lock is the kernel's and goes with that process; of
    the processes of one distributed training only the first takes it.
    """
    name = Path(sys.argv[0]).stem
    record = time_path(run.name, name, run.category, run.seed)
    record.parent.mkdir(parents=True, exist_ok=True)
    with contextlib.ExitStack() as stack:
        first = os.environ.get("RANK", "0") == "0"
        if first:
            busy = f"an earlier process of this stage ({{number}}) is still at work on {run.file}"
            stack.enter_context(locks.held(record.with_suffix(".lock"), busy))
        item = finished.find(name, run)
        note = finished.note(item) if item else notes.Note(record, "")
        done = item is not None and note.fits()
        if first:
            what = f"{name} {run.label}".rstrip()
            sys.stderr.write(f"{what}: nothing to do\n" if done else f"{what}\n")
        if done:
            return
        if item is not None:  # a section that `params` does not list would change without a new run
            listed = {section for names in item.sections.values() for section in names}
            run = dataclasses.replace(run, given={key: value for key, value in run.given.items() if key in listed})
        imported = _largest_child_kib()
        started = time.monotonic()
        make(run)
        seconds = round(time.monotonic() - started, 2)
        note.write(item.outs if item else (), seconds=seconds, **_peak_memory(imported))


def _largest_child_kib() -> int:
    """Largest resident memory of the processes that this one has started and that have ended."""
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss  # KiB on Linux


def _peak_memory(imported: int) -> dict[str, float]:
    """Largest resident memory so far, MiB: of this process, and of the largest worker process that it started.

    `imported` is that of the programs which imports ran before the work: only what is larger is a worker's.

    Pages that processes share, such as those of libraries and of mapped files, count in each of them, and the peaks
    need not coincide: all workers together take at most their number times the second figure. Workers of a Dask
    cluster are not counted. `worker_peak_mib` is 0 without workers.
    """
    loky = sys.modules.get("joblib.externals.loky")
    if loky is not None:  # the kernel counts children that have ended
        loky.get_reusable_executor(reuse=True).shutdown(wait=True)
    own, largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, _largest_child_kib()
    workers = largest if largest > imported else 0
    return {"peak_mib": round(own / 1024, 1), "worker_peak_mib": round(workers / 1024, 1)}
