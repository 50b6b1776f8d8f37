"""An experiment from its file to its report: `ddf run`. DVC notices what changed; here it is decided what that means.

What no stage makes is written here, so that DVC can watch it: the data's folder, the number of seeds, the checksum of
the mesh of a fit, and params.yaml with the items of the graph.
"""

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil
import yaml

from ddf.core import checks, config, locks, storage
from ddf.fit import fit_settings
from ddf_lab.engine import console, experiments, finished, graph, schedule

ITEMS = Path("params.yaml")
LOCK = Path(".make/lock")  # one run at a time in a folder
STALE = Path(".dvc/tmp/rwlock")  # DVC's own, left behind where it was killed


@dataclass(frozen=True)
class Options:
    """How an experiment runs. stages: the last ones wanted; none: the report. seeds: trainings of each model.

    jobs: trainings side by side. data: root of real data, remembered from run to run. launch: put before trainings.
    """

    stages: Sequence[str] = ()
    seeds: int = 1
    jobs: int = 1
    data: str | None = None
    launch: str = ""


def run(given: str, changes: Sequence[str], options: Options) -> Path:
    """Make what is missing or out of date, stage by stage; the page of the report, or the folder of the artefacts.

    Args:
      given, changes: as `experiments.find` takes them.
    Raises:
      InputError: for input at fault, and where a stage failed, which has then said why.
    """
    graph.load()
    with locks.held(LOCK, "another run holds this folder (process {number})") as descriptor:
        STALE.unlink(missing_ok=True)
        experiment = experiments.find(given, changes)
        stages = _known(options.stages or [experiment.last_stage], experiment)
        items = graph.needed(graph.expand(_record(experiment, options)), stages)
        engine = _Engine(_environment(experiment, options), descriptor)
        changed = engine.changed([item for item in items if item.stage in stages])
        stale = engine.stale([item for item in items if item.name in changed])
        failed = schedule.run(graph.affected(items, stale), options.jobs, engine.run, engine.stop)
    if failed:
        raise checks.InputError(f"{failed[0].name} failed, its message is above; the same command goes on from there")
    folder = Path("artifacts") / experiment.name
    return folder / "report" / "README.md" if experiment.last_stage in stages else folder


def _known(stages: Iterable[str], experiment: experiments.Experiment) -> set[str]:
    """The stages, each checked to be one of this kind of experiment."""
    lists = experiment.lists()
    names = [stage for stage, entry in graph.load().items() if lists[entry["foreach"].strip("${}")]]
    for stage in stages:
        if stage not in names:
            raise checks.InputError(f"{experiment.file} has no stage {stage!r}; its stages are {', '.join(names)}")
    return set(stages)


def _record(experiment: experiments.Experiment, options: Options) -> experiments.Lists:
    """Write down what the graph depends on and no stage makes; the lists of its items."""
    folder = Path("artifacts") / experiment.name
    lists = experiment.lists(options.seeds)
    _write(ITEMS, f"# Written by `ddf run`: the items of {experiment.file}\n{yaml.safe_dump(lists, sort_keys=False)}")
    if experiment.kind == "shape":
        mesh = config.load(experiment.file, "fit", fit_settings.FitConfig).mesh
        path = Path(mesh).expanduser() if mesh else None
        _write(folder / "mesh.sha256", f"{storage.checksum(path) if path and path.is_file() else 'no file'}\n")
        return lists
    if experiment.kind == "figures":
        return lists
    _write(folder / "evaluate_seeds" / "count", f"{options.seeds}\n")
    root = folder / "data_root"
    if options.data is not None:
        _write(root, f"{Path(options.data).expanduser().absolute()}\n")
    elif not root.is_file():
        remembered = Path("artifacts") / experiment.base / "data_root"
        _write(root, remembered.read_text(encoding="utf-8") if experiment.base and remembered.is_file() else "\n")
    return lists


def _write(path: Path, text: str) -> None:
    """A file that stays untouched where it says the same already."""
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        storage.write_text(path, text)


def _environment(experiment: experiments.Experiment, options: Options) -> dict[str, str]:
    """Of every stage. Bytecode, which many containers forbid, saves seconds a stage."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    root = Path("artifacts") / experiment.name / "data_root"
    return kept | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}",
        "PYTHONUNBUFFERED": "1",
        "DDF_DATA": root.read_text(encoding="utf-8").rstrip("\n") if root.is_file() else "",
        "LAUNCH": options.launch,
        "PET_NO_PYTHON": "1",  # torchrun in LAUNCH starts the command behind it, which is not a script
    }


class _Engine:
    """DVC as child processes, which hold the lock of the folder for as long as they live."""

    def __init__(self, environment: dict[str, str], descriptor: int) -> None:
        self._environment, self._descriptor = environment, descriptor
        self._console = console.Console(sys.stderr)
        self._running: set[subprocess.Popen[bytes]] = set()

    def _start(self, command: Sequence[str], stdout: int | None, stderr: int | None) -> subprocess.Popen[bytes]:
        inherited = (self._descriptor,)
        return subprocess.Popen(command, env=self._environment, pass_fds=inherited, stdout=stdout, stderr=stderr)

    def changed(self, items: Iterable[graph.Item]) -> set[str]:
        """Names of all items that these depend on, and of these, of which DVC sees that anything changed."""
        command = ["dvc", "status", "--json", "--with-deps", *(item.name for item in items)]
        process = self._start(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        out, errors = process.communicate()
        if process.returncode:
            raise checks.InputError(f"{' '.join(command)} failed: {errors.decode('utf-8', 'replace').strip()}")
        return set(json.loads(out))

    def stale(self, items: Sequence[graph.Item]) -> list[str]:
        """Names of those that have work to do; that the others have none is put down in DVC's record."""
        done = [item for item in items if finished.note(item).fits()]
        if done:
            self._start(["dvc", "commit", "-q", "-f", *(item.name for item in done)], None, None).wait()
        return [item.name for item in items if item not in done]

    def run(self, item: graph.Item) -> bool:
        """Run one item through DVC, which leaves it alone if nothing that it reads changed; whether it succeeded."""
        nice = ["nice", "-n", str(item.nice)] if item.nice else []
        # DVC holds its own lock while it looks at files, for longer than it would wait without being told to; what it
        # remembers of earlier runs (its run cache) is no second place that decides.
        command = [*nice, "dvc", "--wait-for-lock", "repro", "-q", "--no-run-cache", "--single-item", item.name]
        process = self._start(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        assert process.stdout is not None
        self._running.add(process)
        self._console.relay(process.stdout.fileno())
        self._running.remove(process)
        return process.wait() == 0

    def stop(self) -> None:
        """Tell what runs below DVC to end: DVC, which passes no signal on, ends with it."""
        for process in list(self._running):
            with contextlib.suppress(psutil.Error):
                for child in psutil.Process(process.pid).children(recursive=True):
                    with contextlib.suppress(psutil.Error):
                        child.terminate()
