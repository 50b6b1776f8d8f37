"""An experiment from its file to its report: `ddf run`.

Each item of the graph starts when all that it reads is made, in a process of its own, unless its note says that there
is nothing to do (`stage.note`). Where one fails, those that do not need it go on. What no stage makes is written here,
so that it counts as an input: the data's folder, the number of seeds, checksums of the mesh of a fit and of own shapes.
"""

import graphlib
import itertools
import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from concurrent import futures
from pathlib import Path
from typing import Any

from ddf.core import checks, processes, storage
from ddf.data.public import manifest
from ddf.fit import fit_settings
from ddf_lab.engine import graph, stage
from ddf_lab.run import Run, class_of

LOCK = Path(".make/lock")  # one run at a time in a folder
DRAW_SECONDS, LOG_SECONDS = 0.5, 60.0  # between two states of a progress bar, on a terminal and in a log
PATIENCE = 30.0  # seconds until a process that goes on is told once more to end


def run(
    given: str,
    changes: Sequence[str] = (),
    stages: Sequence[str] = (),
    seeds: int = 1,
    jobs: int = 1,
    data: str | None = None,
    launch: str = "",
) -> Path:
    """Make what is missing or out of date; the page of the report, or the folder of the artefacts.

    Args:
      given, changes: as `graph.experiment` takes them. stages: the last ones wanted; none: the report.
      seeds: trainings of each model. jobs: trainings side by side. launch: put before trainings.
      data: root of real data, remembered from run to run.
    Raises:
      InputError: for input at fault, and where a stage failed, which has then said why.
    """
    graph.load()
    with processes.locked(LOCK, "another run holds this folder (process {number})") as descriptor:
        experiment = graph.experiment(given, changes)
        items = graph.expand(experiment, seeds)
        names = list(dict.fromkeys(item.stage for item in items))
        stages = stages or names[-1:]
        for each in stages:
            if each not in names:
                raise checks.InputError(f"{experiment.file} has no stage {each!r}; its stages are {', '.join(names)}")
        _record(experiment, seeds, data)
        items = graph.needed(items, stages)
        work = _Work(experiment.root / "data_root", launch, descriptor, len(items))
        failed = schedule(items, jobs, work.run, work.stop)
    if failed:
        raise checks.InputError(f"{failed[0].name} failed, its message is above; the same command goes on from there")
    return experiment.page / "README.md" if names[-1] in stages else experiment.root


def _record(experiment: Run, seeds: int, data: str | None) -> None:
    """Write down what items depend on and no stage makes."""
    folder = experiment.root
    if experiment.kind == "shape":
        mesh = experiment.section(fit_settings.FitConfig).mesh
        path = Path(mesh).expanduser() if mesh else None
        found = storage.checksum(path) if path and path.is_file() else "no file"
        graph.write(folder / "mesh.sha256", f"{found}\n")
    elif experiment.kind != "figures":
        graph.write(folder / "evaluate_seeds" / "count", f"{seeds}\n")
        if experiment.kind == "reconstruction":
            train, how = (experiment.section(class_of(name)) for name in ("train", "ddf_image"))
            starts = [how.started(train, category)[2] for category in experiment.categories]
            graph.write(folder / "start.sha256", "".join(f"{storage.checksum(each)}\n" for each in starts if each))
        root = folder / "data_root"
        remembered = folder.with_name(folder.name.partition("+")[0]) / "data_root"  # of what it is a variant of
        if own := experiment.section(class_of("dataset")).own:
            table = own.expanduser() / manifest.FILE
            if data is not None:
                raise checks.InputError(f"--data is of ShapeNet, but dataset.own is {own}; leave one out")
            if not table.is_file():
                raise checks.InputError(f"{table}: is not there, as `ddf shapes add` writes it")
            graph.write(root, f"{storage.checksum(table)}\n")
        elif data is not None:
            graph.write(root, f"{Path(data).expanduser().absolute()}\n")
        elif not root.is_file():
            graph.write(root, remembered.read_text(encoding="utf-8") if remembered.is_file() else "\n")


def schedule(
    items: Sequence[graph.Item], jobs: int, start: Callable[[graph.Item], bool], stop: Callable[[], None] = lambda: None
) -> list[graph.Item]:
    """Call `start` for every item whose forerunners succeeded, as many side by side as their stages say.

    Args:
      items: in the order of the graph; those of the first seed go first. jobs: side by side, where a stage says so.
      start: does the work; whether it succeeded. stop: ends what runs, where the call is interrupted.
    Returns:
      The items that failed or were left out because of one that did; first those that failed, as they ended.
    """
    order = sorted(items, key=lambda item: item.seed)
    sorter = graphlib.TopologicalSorter({each: [other for other in items if each.follows(other)] for each in items})
    sorter.prepare()
    ready, failed, succeeded = list[graph.Item](), list[graph.Item](), set[graph.Item]()
    running: dict[futures.Future[bool], graph.Item] = {}

    def may_start(item: graph.Item) -> bool:
        together = item.entry.together
        room = len(running) < (jobs if together == "jobs" else together)
        return room and all(other.entry.together == together for other in running.values())

    with futures.ThreadPoolExecutor(max(1, len(items))) as pool:
        try:
            while (ready := sorted((*ready, *sorter.get_ready()), key=order.index)) or running:
                for item in filter(may_start, tuple(ready)):
                    ready.remove(item)
                    running[pool.submit(start, item)] = item
                for future in futures.wait(running, return_when=futures.FIRST_COMPLETED).done:
                    item = running.pop(future)
                    if future.result():
                        succeeded.add(item)
                        sorter.done(item)
                    else:
                        failed.append(item)
        except BaseException:
            stop()  # before the threads are waited for
            raise
    return failed + [item for item in order if item not in succeeded and item not in failed]


class _Work:
    """So many stages as child processes, which hold the lock of the folder for as long as they live."""

    def __init__(self, root: Path, launch: str, descriptor: int, number: int) -> None:
        self._environment = {
            **{name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"},
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}",
            "PYTHONUNBUFFERED": "1",
            "DDF_DATA": root.read_text(encoding="utf-8").rstrip("\n") if root.is_file() else "",
            "LAUNCH": launch,
        }
        self._descriptor, self._number, self._count = descriptor, number, itertools.count(1)
        self._console = Console(sys.stderr)
        self._running: set[subprocess.Popen[bytes]] = set()
        self._stopped, self._starting = False, threading.Lock()

    def run(self, item: graph.Item) -> bool:
        """Run one item, unless there is nothing to do; whether it succeeded."""
        part, known = next(self._count), stage.checksums(item)
        done = stage.note(item, known).fits()
        known.write()
        with self._starting:
            if done or self._stopped:
                return done
            process = subprocess.Popen(
                ["/bin/sh", "-c", f"exec {item.command}"],
                env=self._environment | {stage.PART: f" ({part} of {self._number})"},
                pass_fds=(self._descriptor,),
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
            )
            self._running.add(process)
        assert process.stdout is not None
        with process.stdout as said:
            self._console.relay(said.fileno())
        code = process.wait()
        self._running.remove(process)
        return code == 0

    def stop(self) -> None:
        """End what runs; nothing starts after it."""
        with self._starting:
            self._stopped = True
        end(list(self._running))


def end(running: Sequence[subprocess.Popen[bytes]]) -> None:
    """Tell processes to end until all have: Python loses a signal that comes while it clears an object away."""
    while running := [process for process in running if process.poll() is None]:
        for process in running:
            process.terminate()
        patience = time.monotonic() + PATIENCE
        while time.monotonic() < patience and any(process.poll() is None for process in running):
            time.sleep(0.05)


class Console:
    """Writes what processes that run side by side say, in whole lines.

    On a terminal their progress bars take turns in one line below. In a log a bar is written once a minute, and its
    last state.
    """

    def __init__(self, stream: Any) -> None:
        self._stream, self._lock = stream, threading.Lock()
        self._terminal = stream.isatty()

    def relay(self, descriptor: int) -> None:
        """Read a process's output to its end."""
        rest, shown = b"", time.monotonic()
        while block := os.read(descriptor, 65536):
            *lines, rest = (rest + block).split(b"\n")
            for line in lines:
                self._write(line)
            if b"\r" in rest:
                rest = b"\r" + rest.rstrip(b"\r").rsplit(b"\r", 1)[-1]
                if time.monotonic() - shown >= (DRAW_SECONDS if self._terminal else LOG_SECONDS):
                    self._write(rest, stays=not self._terminal)
                    shown = time.monotonic()
        self._write(rest)

    def _write(self, line: bytes, stays: bool = True) -> None:
        """What a line shows at its end: the text after its last carriage return that is followed by any."""
        states = (part.strip() for part in reversed(line.decode("utf-8", "replace").split("\r")))
        if text := next(filter(None, states), ""):
            if self._terminal:
                text = "\r\x1b[K" + text[: None if stays else shutil.get_terminal_size().columns - 1]
            with self._lock:
                self._stream.write(text + "\n" if stays else text)
                self._stream.flush()
