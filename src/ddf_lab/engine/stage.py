"""The frame around a stage script: arguments, whether there is anything to do, log, and errors in one line.

A finished stage leaves a note (`ddf.core.notes`) of its outputs' checksums and of a fingerprint: its config sections,
the contents of its inputs, and the syntax trees of its script and of every module that the script reaches outside this
room. While the note fits, the stage has nothing to do.
"""

import argparse
import contextlib
import dataclasses
import hashlib
import json
import logging
import os
import shutil
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from ddf.core import config, notes, processes, provenance, storage
from ddf_lab.engine import graph
from ddf_lab.run import Run, class_of, time_path

FRAME = "ddf_lab/engine"  # the room around the stages: no result depends on it
PAGE = "report"  # an output that is made anew each time; all others go on from what an earlier run left
PART = "DDF_PART"  # variable of the environment: which of how many stages of a run this is
Make = Callable[[Run], None]


def note(item: graph.Item, checksum: notes.Checksum = storage.checksum) -> notes.Note:
    """The note of the item's last run, as a run of now would write it; its seconds stand in it too."""
    content = {**made_by(item), "data": [checksum(path) if Path(path).exists() else None for path in item.inputs]}
    fingerprint = hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()
    return notes.Note(time_path(item.file.stem, item.stage, item.category, item.seed), fingerprint, checksum)


def made_by(item: graph.Item) -> dict[str, Any]:
    """Settings and code of an item, today's."""
    given = Run.read(item.file)
    return {
        "config": {name: config.plain(given.section(class_of(name))) for name in item.entry.sections},
        "code": provenance.script_version(f"stages/{item.stage}.py", without=FRAME),
    }


def checksums(item: graph.Item) -> notes.Checksums:
    """Of the files of the item's experiment, as far as they are known."""
    return notes.Checksums(Path("artifacts") / item.file.stem / "checksums.json")


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
        parser.add_argument("--seed", type=int, default=0, help="added to the config's seeds (default 0)")
    arguments = vars(parser.parse_args())
    logging.basicConfig(level=logging.INFO, format="%(message)s", stream=sys.stderr)
    kept = "what is finished is kept, and the same command goes on from there"
    with processes.raised():
        sys.exit(processes.guarded(lambda: _run_alone(make, Run.read(**arguments)), Path(sys.argv[0]).stem, kept))


def _run_alone(make: Make, run: Run) -> None:
    """Run while holding the stage's lock, then note its seconds and what was made of what.

    Where the note of an earlier run fits, nothing is done. A killed engine can leave a stage's process behind that
    still writes the same files. The lock is the kernel's and goes with that process.
    """
    name = Path(sys.argv[0]).stem
    record = time_path(run.name, name, run.category, run.seed)
    record.parent.mkdir(parents=True, exist_ok=True)
    with contextlib.ExitStack() as stack:
        busy = f"an earlier process of this stage ({{number}}) is still at work on {run.file}"
        stack.enter_context(processes.locked(record.with_suffix(".lock"), busy))
        item = graph.find(name, run)
        made = notes.Note(record, "") if item is None else note(item, checksums(item))
        done = item is not None and made.fits()
        what = f"{name} {run.label}".rstrip() + os.environ.get(PART, "")
        sys.stderr.write(f"{what}: nothing to do\n" if done else f"{what}\n")
        if done:
            return
        outputs = [] if item is None else item.outputs
        if item is not None:  # a section that the graph does not list would change without a new run
            listed = {name: run.given[name] for name in run.given if name in item.entry.sections}
            run = dataclasses.replace(run, given=listed)
        for out in outputs:
            if Path(out).name == PAGE:
                shutil.rmtree(out, ignore_errors=True)
        started = time.monotonic()
        make(run)
        made.write(outputs, seconds=round(time.monotonic() - started, 2))
