"""One training on two processes against the same on one."""

import os
import subprocess
import sys
from pathlib import Path

import _support
import _together
import pytest
import torch

from ddf.core import checks, distributed, storage
from ddf.fields import model_files
from ddf.training import training_loop


def _torchrun(folder):
    script = Path(_together.__file__)
    path = os.pathsep.join(map(str, (script.parents[2], Path(distributed.__file__).parents[2])))
    # without options of torchrun, which make sets
    own = {name: value for name, value in os.environ.items() if not name.startswith("PET_")}
    environment = {**own, "PYTHONPATH": path, "CUDA_VISIBLE_DEVICES": ""}
    command = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node", "2", script, folder]
    return subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Folders of the trainings on one process and on two."""
    one, two = tmp_path_factory.mktemp("one"), tmp_path_factory.mktemp("two")
    started = _torchrun(two)
    _together.train_all(one)
    _, errors = started.communicate(timeout=240)
    assert started.returncode == 0, errors
    return one, two


def _tensors(folder):
    return storage.load_tensors(folder / model_files.MODEL, framework="torch")[0]


def _log(folder):
    return [{name: value for name, value in row.items() if name != "seconds"} for row in training_loop.read_log(folder)]


def test_parameters_and_batch_statistics_equal_those_of_one_process(runs):
    one, two = (_tensors(folder / "exact") for folder in runs)
    assert one.keys() == two.keys() == _together.exact_model().state_dict().keys()
    for name, values in one.items():
        _support.assert_close(two[name], values, atol=1e-11, rtol=1e-11)
    assert float((one["1.running_mean"]).abs().min()) > 0.01  # the statistics have moved


@pytest.mark.parametrize("kind", _together.KINDS)
def test_reconstruction_models_learn_the_same_as_on_one_process(runs, kind):
    """float32: Adam turns the rounding of a gradient near zero into a step of any sign, so the path is what counts."""
    start = dict(_together.fresh(kind)[0].named_parameters())
    one, two = (_tensors(folder / kind) for folder in runs)
    path, apart = (
        sum(float((one[name] - other[name]).detach().double().square().sum()) for name in start) ** 0.5
        for other in (start, two)
    )
    assert path > 0.1
    assert apart < 1e-2 * path


@pytest.mark.parametrize("kind", ["exact", *_together.KINDS])
def test_log_is_that_of_the_whole_batch(runs, kind):
    one, two = (_log(folder / kind) for folder in runs)
    assert len(one) == len(two) == _together.STEPS
    for expected, row in zip(one, two, strict=True):
        assert row == pytest.approx(expected, rel=3e-3, abs=1e-6)


def test_two_processes_leave_one_set_of_files_and_have_the_threads_of_the_config(runs):
    one, two = runs
    for kind in ("exact", *_together.KINDS):
        assert sorted(os.listdir(two / kind)) == sorted(os.listdir(one / kind))
    assert (two / "after").exists()  # `touch` by a second process would have failed
    assert [(two / f"threads.{number}").read_text() for number in (0, 1)] == ["2", "2"]


def test_resumed_twice_equals_uninterrupted(runs):
    for name in (model_files.MODEL, training_loop.CHECKPOINT):
        assert (runs[1] / "resumed" / name).read_bytes() == (runs[1] / "exact" / name).read_bytes()


def test_processes_that_read_different_data_are_refused_on_each(runs):
    for number in (0, 1):
        message = (runs[1] / f"refused.{number}").read_text()
        assert "differ between processes" in message
        assert f"process {number}: data of {number} at step 0" in message
    assert not (runs[1] / "none").exists()


def test_alone_there_is_one_part_and_nothing_is_exchanged():
    parameter = torch.nn.Parameter(torch.ones(3))
    parameter.grad = gradient = torch.full((3,), 2.0)
    distributed.average_gradients([parameter])
    assert parameter.grad is gradient
    assert (distributed.rank(), distributed.count(), distributed.part(5)) == (0, 1, slice(0, 5))
    values = {"loss": torch.tensor(1.0)}
    assert distributed.means(values) is values
    seen = []
    distributed.shared(seen.append)("run")
    assert seen == ["run"]


def test_processes_that_cannot_share_the_work_are_refused(monkeypatch):
    monkeypatch.setenv("WORLD_SIZE", "2")
    with pytest.raises(checks.InputError, match="runs on one process; got 2"):
        training_loop.prepare(_together.LOOP)
    monkeypatch.setattr(distributed, "count", lambda: 3)
    with pytest.raises(checks.InputError, match="multiple of the 3 processes; got 4"):
        training_loop.prepare(_together.LOOP, 4)
