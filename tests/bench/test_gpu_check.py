"""The GPU check, tried on the CPU; and what it holds a device to, on the GPU where there is one (`make test-gpu`)."""

import dataclasses
import importlib.metadata
import json
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from bench.gpu import casts, gpu_check, parity, rates, sizes
from ddf.core import checks
from ddf.training import training_loop
from ddf_lab.engine import step_cost

ROOT = Path(__file__).resolve().parents[2]
LIGHT = ("torch", "pillow", "numpy", "safetensors", "jaxtyping", "tqdm", "pyyaml")
ABSENT = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
DEVICES = ("cpu", pytest.param("cuda", marks=(pytest.mark.gpu, ABSENT)))


@pytest.fixture(autouse=True)
def _root(monkeypatch):
    monkeypatch.chdir(ROOT)  # where the configs are


def _needs(names, found):
    """Distributions that these need, themselves included."""
    for name in names:
        key = name.lower().replace("_", "-")
        if key not in found:
            try:
                found[key] = importlib.metadata.distribution(name)
            except importlib.metadata.PackageNotFoundError:
                continue  # of another platform
            required = [line.split(";") for line in found[key].requires or []]
            plain = [line[0] for line in required if not any("extra" in part for part in line[1:])]
            _needs([next(iter(_words(line))) for line in plain], found)
    return found


def _words(requirement):
    for sign in "<>=!~[( ":
        requirement = requirement.split(sign)[0]
    yield requirement.strip()


def _link(folder, names):
    """A folder of packages with these alone and what they need."""
    folder.mkdir()
    for distribution in _needs(names, {}).values():
        for file in distribution.files or ():
            top = file.parts[0]
            if top not in ("..", "__pycache__") and not (folder / top).exists():
                (folder / top).symlink_to(Path(str(distribution.locate_file(top))))
    return folder


def test_check_runs_with_a_handful_of_packages_alone(tmp_path):
    site = _link(tmp_path / "site", LIGHT)
    assert not (site / "open3d").exists() and (site / "torch").exists()
    environment = {"PYTHONPATH": f"{site}:{ROOT / 'src'}:{ROOT}", "PATH": "/usr/bin", "OMP_NUM_THREADS": "1"}
    command = ["-m", "bench", "gpu_check", "--device", "cpu", "--tiny", "--out", str(tmp_path / "gpu")]
    done = subprocess.run([sys.executable, "-S", *command], cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    record = json.loads((tmp_path / "gpu" / "check.json").read_text())
    assert [row["what"] for row in record["steps"]] == [
        *(f"{model} step, {precision}" for model in ("ddf", "pcsiren") for precision in rates.PRECISIONS),
        "ddf step, tf32, without data on the device",
        "ddf step, tf32, without compiled passes",
    ]
    (cast,) = record["casts"]
    assert cast["what"] == "operators" and cast["error"]["other_hits"] == 0 and cast["error"]["depth_max"] < 1e-5
    assert len(record["clouds"]) == 4 and all(row["median_s"] > 0 for row in record["clouds"])
    assert all(row["kernels"] > 0 and row["median_s"] > 0 and row["loss"] > 0 for row in record["steps"])
    text = (tmp_path / "gpu" / "check.md").read_text()
    assert text.count("| ddf step, ") == 2 * (len(rates.PRECISIONS) + 2) and "on the CPU alone" in text


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a CUDA device")
def test_without_a_gpu_one_line_says_so():
    with pytest.raises(checks.InputError, match="finds no CUDA device; `--device cpu --tiny` tries the check"):
        gpu_check.main([])


def test_differences_are_relative_and_of_the_same_parameters():
    truth = (2.0, {"a": torch.tensor([3.0, 0.0]).double(), "b": torch.tensor([4.0]).double()})
    own = (2.02, {"a": torch.tensor([3.0, 0.5]).double(), "b": torch.tensor([4.0]).double()})
    found = parity.differences(own, truth)
    assert found["loss_relative"] == pytest.approx(0.01)
    assert found["gradient_relative"] == pytest.approx(0.1)
    assert found["worst_parameter_relative"] == pytest.approx(0.5 / 3)
    assert found["gradient_cosine"] == pytest.approx(25 / (5 * 25.25**0.5))
    with pytest.raises(ValueError, match=r"other parameters: \['b'\]"):
        parity.differences((2.0, {"a": own[1]["a"]}), truth)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("model", ["ddf", "pcsiren"])
def test_loss_and_gradients_are_those_of_the_cpu(model, device):
    how = sizes.tiny()
    truth = parity.gradients(how, model, "cpu", "float32")
    assert float(truth[1]["shape_encoder.fc.weight"].norm()) > 0
    exact = parity.differences(parity.gradients(how, model, device, "float32"), truth)
    assert exact["loss_relative"] < 1e-5 and exact["gradient_relative"] < 1e-4
    rounded = parity.differences(parity.gradients(how, model, device, "bfloat16"), truth)
    assert rounded["loss_relative"] < 2e-2 and rounded["gradient_cosine"] > 0.999


def _trained(how, model, device, steps, folder, stop_at=None):
    """Weights after so many steps, written to a folder; a stopped training raises KeyboardInterrupt."""
    loop = dataclasses.replace(how.train.loop, checkpoint_seconds=0.0)
    with parity.placed(device):
        training_loop.prepare(loop)
        trial = step_cost.trial(dataclasses.replace(how.train, loop=loop), how.sections[model])

        def loss(step):
            if step == stop_at:
                raise KeyboardInterrupt
            return trial.loss(step)

        groups = trial.model.parameter_groups()
        training_loop.fit(trial.model, groups, loss, steps, loop, folder, {"fingerprint": "x"}, model)
        return {name: value.detach().cpu().double() for name, value in trial.model.named_parameters()}


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("model", ["ddf", "pcsiren"])
def test_steps_and_a_resumed_training_are_those_of_the_cpu(model, device, tmp_path):
    how = sizes.tiny()
    truth = _trained(how, model, "cpu", 3, tmp_path / "cpu")
    with pytest.raises(KeyboardInterrupt):
        _trained(how, model, device, 3, tmp_path / "stopped", stop_at=2)
    resumed = _trained(how, model, device, 3, tmp_path / "stopped")
    rate = how.train.loop.learning_rate
    for name, value in truth.items():
        # a step of Adam has the size of the rate whatever the gradient, so that rounding of a tiny one may turn it
        assert float((resumed[name] - value).abs().max()) <= (0 if device == "cpu" else 6.1 * rate), name
    moved = torch.cat([(resumed[name] - value).abs().flatten() for name, value in truth.items()])
    assert float((moved > 0.1 * rate).double().mean()) < 0.02


@pytest.mark.parametrize("device", DEVICES)
def test_rays_are_cast_as_in_float64(device):
    how = dataclasses.replace(sizes.tiny(), cast_rays=casts.CHECKED)
    with parity.placed(device):
        (row,) = casts.rows(how, device)
    assert row["what"] == ("kernel" if device == "cuda" else "operators")
    assert row["error"]["other_hits"] == 0 and 0 < row["error"]["depth_max"] < 1e-5
    assert abs(len(casts.bumpy_sphere(10_000, 0)) - 10_000) < 300


@pytest.mark.parametrize("device", DEVICES)
def test_hits_of_a_cloud_are_those_of_the_cpu(device):
    how = sizes.tiny()
    off = (parity.hits(how, device) - parity.hits(how, "cpu")).norm(dim=-1)
    assert float(off.median()) < 1e-5 and float((off > 1e-3).double().mean()) < 0.02
