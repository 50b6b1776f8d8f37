"""Maps over many shapes: shards on local processes, or on a Dask cluster when DASK_SCHEDULER_ADDRESS is set.

A shard is done when its note `NNN.json` fits (`notes`), which holds its failures too. A run that was killed continues
with the others.
"""

import contextlib
import dataclasses
import hashlib
import json
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any, TypeVar

import joblib
import tqdm
from joblib.externals import loky

from ddf.core import checks, notes, provenance, storage

MAX_FAILURE_SHARE = 0.02
SCHEDULER_SECONDS = 20  # to wait for the Dask scheduler
_SHOWN = 5  # items left out that are said one by one
SMALL_RUN = 50  # below this many items, one failure is allowed although it is more than 2 %

Item = TypeVar("Item")


def shard_size(count: int, most: int = 40, shards: int = 3) -> int:
    """Items of a shard, 4 to `most`, so that there are `shards` where that can be; packs of 40 shapes stay open."""
    return max(4, min(most, count // shards))


@dataclasses.dataclass(frozen=True)
class Failure:
    """One item that could not be processed."""

    id: str
    stage: str
    reason: str


@dataclasses.dataclass(frozen=True)
class ShardResult:
    """What one shard did: the files it wrote (inside the output folder) and the items it left out."""

    files: Sequence[Path]
    failures: Sequence[Failure] = ()


@dataclasses.dataclass(frozen=True)
class Shard:
    """Where the files of one shard go. fingerprint: of everything that they depend on besides the items."""

    out_dir: Path
    index: int
    fingerprint: str

    def file(self, suffix: str) -> Path:
        """`NNN<suffix>`."""
        return self.out_dir / f"{self.index:03d}{suffix}"


ShardFunction = Callable[[Sequence[Any], Shard], ShardResult]


def map_shards(
    function: ShardFunction,
    items: Sequence[Item],
    *,
    shard_size: int,
    out_dir: str | Path,
    fingerprint: str,
    describe: str,
    jobs: int | None = None,
) -> list[Failure]:
    """Run `function(items, shard)` for every shard that is not done yet; progress goes to stderr.

    The function writes its files to `shard.file` (through `storage`), catches what a broken item raises and reports it
    as a Failure. An item that kills its process is found, reported and left out. Files that no current shard owns are
    removed. All failures are written to `failures.csv`, and up to five are said.

    Args:
      items: JSON-like values, or dataclasses with an `id`, in the order of the data set; sent to other processes.
      fingerprint: of everything that the result depends on besides the items themselves.
      describe: the stage's name, for the progress bar and failures.
    Returns:
      The failures of all shards, in the order of the items.
    Raises:
      InputError: more than 2 % of the items failed (one of fewer than 50 is allowed).
    """
    out_dir = Path(out_dir)
    out_dir.mkdir(parents=True, exist_ok=True)
    parts = [items[start : start + shard_size] for start in range(0, len(items), shard_size)]
    tasks = [_Task(function, part, Shard(out_dir, i, fingerprint)) for i, part in enumerate(parts)]
    waiting = [task for task in tasks if not task.note.fits()]
    _run_all(waiting, describe, len(tasks), jobs)
    for task in waiting:
        if not task.note.path.exists():
            _run_isolated(task, describe)
    told = {task.note.path: storage.read_json(task.note.path) for task in tasks}
    owned = {*told, *(out_dir / name for record in told.values() for name in record["files"])}
    for path in out_dir.iterdir():
        if path.is_file() and path not in owned:  # left by killed runs, or by earlier, longer data sets
            path.unlink()
    failures = [Failure(**failure) for record in told.values() for failure in record["failures"]]
    _report(failures, len(items), describe, out_dir / "failures.csv")
    return failures


def digest(out_dir: str | Path) -> str:
    """One checksum of what a finished `map_shards` left in its folder: the files of every shard and the failures."""
    records = [storage.read_json(path) for path in sorted(Path(out_dir).glob(storage.RECORDS))]
    left = [[record["files"], record["failures"]] for record in records]
    return hashlib.sha256(json.dumps(left, sort_keys=True).encode()).hexdigest()


@dataclasses.dataclass(frozen=True)
class _Task:
    function: ShardFunction
    items: Sequence[Any]
    shard: Shard

    @property
    def note(self) -> notes.Note:
        text = json.dumps([provenance.plain(item) for item in self.items], sort_keys=True, default=str)
        key = hashlib.sha256(f"{self.shard.fingerprint}\n{text}".encode()).hexdigest()
        return notes.Note(self.shard.file(".json"), key)

    def run(self, extra: Sequence[Failure] = ()) -> None:
        """Do the work, then write the note: in this order, so that a note means a whole shard."""
        self.note.path.unlink(missing_ok=True)
        result = self.function(self.items, self.shard)
        failures = [dataclasses.asdict(failure) for failure in [*result.failures, *extra]]
        self.note.write(result.files, failures=failures)

    def survives(self, extra: Sequence[Failure] = ()) -> bool:
        """Run in a process of its own; False when that process died. Exceptions come through."""
        with loky.ProcessPoolExecutor(max_workers=1) as executor, contextlib.suppress(BrokenProcessPool):
            executor.submit(self.run, extra).result()
            return True
        return False


def _run_all(tasks: Sequence[_Task], describe: str, total: int, jobs: int | None) -> None:
    """All tasks on the workers; returns early, leaving tasks without a record, when a worker process dies."""
    done = total - len(tasks)
    for task in tasks:
        task.note.path.unlink(missing_ok=True)
    with tqdm.tqdm(total=total, initial=done, desc=describe, unit="shard") as progress:
        # At least two, because joblib runs a single job inside this process, which a bad mesh could then kill.
        workers = max(2, jobs or joblib.cpu_count())
        with _backend(), contextlib.suppress(BrokenProcessPool):
            for _ in joblib.Parallel(n_jobs=workers, return_as="generator_unordered")(
                joblib.delayed(_Task.run)(task) for task in tasks
            ):
                progress.update()


@contextlib.contextmanager
def _backend() -> Iterator[None]:
    address = os.environ.get("DASK_SCHEDULER_ADDRESS")
    if not address:
        yield
        return
    from dask import distributed

    with distributed.Client(address, timeout=SCHEDULER_SECONDS), joblib.parallel_config(backend="dask"):
        yield


def _run_isolated(task: _Task, describe: str) -> None:
    """A shard that lost its process: try each item alone, then run the shard without those that kill a process."""
    lost = [item for item in task.items if not dataclasses.replace(task, items=[item]).survives()]
    died = "its process died (crash in native code, or out of memory)"
    whole = dataclasses.replace(task, items=[item for item in task.items if item not in lost])
    if not whole.survives([Failure(_name(item), describe, died) for item in lost]):
        raise checks.InputError(
            f"{describe}: shard {task.shard.index} ({_name(task.items[0])} ...) ended its process, although its items "
            "pass one by one; check the memory, or use smaller shards"
        )


def _name(item: Any) -> str:
    return getattr(item, "id", str(item))


def _report(failures: Sequence[Failure], total: int, describe: str, path: Path) -> None:
    """Say up to five failures, list all in a file, and raise where there are too many."""
    reasons = [" ".join(failure.reason.split()) for failure in failures]
    rows = [(each.id, each.stage, reason) for each, reason in zip(failures, reasons, strict=True)]
    storage.write_rows(path, [("id", "stage", "reason"), *rows])
    for failure, reason in [*zip(failures, reasons, strict=True)][:_SHOWN]:
        sys.stderr.write(f"{describe}: left out {failure.id}: {reason[:300]}\n")
    if len(failures) > _SHOWN:
        sys.stderr.write(f"{describe}: {len(failures)} left out in all, listed in {path}\n")
    allowed = max(int(MAX_FAILURE_SHARE * total), 1 if 1 < total < SMALL_RUN else 0)
    if len(failures) > allowed:
        raise checks.InputError(
            f"{describe}: {len(failures)} of {total} shapes failed (at most {allowed} may), the first one "
            f"{failures[0].id}: {reasons[0]}; all are listed in {path}"
        )
