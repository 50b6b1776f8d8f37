"""Maps in shards: resumed, repaired, and stopped by too many failures, but not by one."""

import os
import signal
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import pytest

from ddf.core import checks, notes, parallel, storage


def _square(bad: set[int], killers: set[int], items, shard: parallel.Shard) -> parallel.ShardResult:
    failures, lines = [], []
    for item in items:
        if item in killers:
            os.kill(os.getpid(), signal.SIGKILL)
        elif item in bad:
            failures.append(parallel.Failure(str(item), "square", "is\nbad"))
        else:
            lines.append(str(item * item))
    path = shard.file(".txt")
    storage.write_text(path, "\n".join(lines))
    with (shard.out_dir.parent / "calls").open("a") as log:
        log.write(f"{shard.index}\n")
    return parallel.ShardResult([path], failures)


def _map(out_dir: Path, items: Sequence[int] = range(10), bad=(), killers=(), **options):
    (out_dir.parent / "calls").write_text("")
    options = {"shard_size": 4, "fingerprint": "f", "describe": "square", **options}
    return parallel.map_shards(partial(_square, set(bad), set(killers)), list(items), out_dir=out_dir, **options)


def _calls(out_dir: Path) -> list[int]:
    """Shards that were computed, sorted."""
    return sorted(map(int, (out_dir.parent / "calls").read_text().split()))


def test_a_note_fits_while_all_its_files_are_as_they_were(tmp_path):
    files = [tmp_path / name for name in ("a", "b")]
    for file in files:
        file.write_text("1")
    (note := notes.Note(tmp_path / "note.json", "f")).write(files)
    assert note.fits()
    files[1].write_text("2")
    assert not note.fits()


@pytest.fixture
def out_dir(tmp_path: Path) -> Path:
    return tmp_path / "out"


def test_every_item_is_mapped_once_in_order(out_dir):
    assert _map(out_dir) == []
    assert _calls(out_dir) == [0, 1, 2]
    text = [(out_dir / f"{i:03d}.txt").read_text().split() for i in range(3)]
    assert [int(word) for words in text for word in words] == [i * i for i in range(10)]
    assert [len(words) for words in text] == [4, 4, 2]
    assert (out_dir / "failures.csv").read_text() == "id,stage,reason\n"


def test_only_damaged_missing_or_changed_shards_run_again(out_dir):
    _map(out_dir)
    good = (out_dir / "001.txt").read_bytes()
    for damage in (good[:-1], good[:-1] + b"x", None):
        if damage is None:
            (out_dir / "001.txt").unlink()
        else:
            (out_dir / "001.txt").write_bytes(damage)
        _map(out_dir)
        assert _calls(out_dir) == [1]
        assert (out_dir / "001.txt").read_bytes() == good
    (out_dir / "002.json").write_text('{"fingerprint": "half')
    _map(out_dir)
    assert _calls(out_dir) == [2]
    _map(out_dir, items=[0, 1, 2, 3, 4, 5, 6, 70, 8, 9])
    assert _calls(out_dir) == [1]
    _map(out_dir, items=[0, 1, 2, 3, 4, 5, 6, 70, 8, 9], fingerprint="g")
    assert _calls(out_dir) == [0, 1, 2]


def test_the_digest_tells_other_files_and_other_failures_apart(tmp_path):
    found = {}
    for name, options in {
        "first": {},
        "again": {"fingerprint": "other"},  # made anew, to the same
        "fewer": {"items": range(9)},
        "failed": {"items": range(50), "bad": {49}},  # its files are those of 49 items
        "whole": {"items": range(49), "shard_size": 4},
    }.items():
        _map(tmp_path / name, **options)
        found[name] = parallel.digest(tmp_path / name)
    assert found["first"] == found["again"]
    assert len(set(found.values())) == 4


def test_a_shorter_data_set_leaves_no_stray_files(out_dir):
    _map(out_dir)
    (out_dir / ".half.tmp").write_text("left by a kill")
    _map(out_dir, items=range(4))
    assert sorted(os.listdir(out_dir)) == ["000.json", "000.txt", "failures.csv"]
    assert _map(out_dir, items=[]) == [] and os.listdir(out_dir) == ["failures.csv"]


def test_failures_are_recorded_and_survive_a_resume(out_dir):
    expected = [parallel.Failure("5", "square", "is\nbad")]
    assert _map(out_dir, bad=[5]) == expected
    assert _map(out_dir, bad=[5]) == expected
    assert _calls(out_dir) == []
    assert (out_dir / "failures.csv").read_text() == "id,stage,reason\n5,square,is bad\n"
    assert (out_dir / "001.txt").read_text().split() == ["16", "36", "49"]


@pytest.mark.parametrize(
    ("total", "bad", "ok"), [(10, 1, True), (10, 2, False), (1, 1, False), (50, 1, True), (60, 2, False)]
)
def test_more_than_two_percent_stop_the_run(out_dir, total, bad, ok):
    if ok:
        assert len(_map(out_dir, items=range(total), bad=range(bad), shard_size=30)) == bad
        return
    told = rf"square: {bad} of {total} shapes failed .* the first one 0: is bad;"
    with pytest.raises(checks.InputError, match=told) as caught:
        _map(out_dir, items=range(total), bad=range(bad), shard_size=30)
    assert "\n" not in str(caught.value)
    assert len((out_dir / "failures.csv").read_text().splitlines()) == 1 + bad


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:A worker stopped")
def test_an_item_that_kills_its_process_is_left_out(out_dir):
    failures = _map(out_dir, killers=[6])
    assert [(failure.id, failure.stage) for failure in failures] == [("6", "square")]
    assert "process died" in failures[0].reason
    squares = [(out_dir / f"{i:03d}.txt").read_text().split() for i in range(3)]
    assert squares == [["0", "1", "4", "9"], ["16", "25", "49"], ["64", "81"]]


def _slow(items, shard: parallel.Shard) -> parallel.ShardResult:
    time.sleep(0.01 * (5 - shard.index))
    return _square(set(), set(), items, shard)


def _contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_result_does_not_depend_on_the_number_of_workers(tmp_path):
    made = {"shard_size": 2, "fingerprint": "f", "describe": "x"}
    folders = [tmp_path / str(jobs) / "out" for jobs in (2, 4)]
    for folder, jobs in zip(folders, (2, 4), strict=True):
        folder.mkdir(parents=True)
        parallel.map_shards(_slow, list(range(10)), out_dir=folder, jobs=jobs, **made)
    assert _contents(folders[0]) == _contents(folders[1])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_dask_cluster_makes_the_same_files(tmp_path, monkeypatch):
    from dask import distributed  # a backend for clusters: nothing else in the suite needs it

    here, there = tmp_path / "a" / "out", tmp_path / "b" / "out"
    for out_dir in (here, there):
        out_dir.mkdir(parents=True)
    _map(here, range(40), bad=[5])
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        monkeypatch.setenv("DASK_SCHEDULER_ADDRESS", cluster.scheduler_address)
        _map(there, range(40), bad=[5])
    assert _contents(there) == _contents(here)


def test_an_unreachable_scheduler_is_one_line(out_dir, monkeypatch):
    monkeypatch.setenv("DASK_SCHEDULER_ADDRESS", "tcp://127.0.0.1:1")
    monkeypatch.setattr(parallel, "SCHEDULER_SECONDS", 1)
    with pytest.raises(OSError, match=r"127\.0\.0\.1:1"):
        _map(out_dir)
