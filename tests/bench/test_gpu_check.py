"""The GPU check, tried on the CPU; and what it holds a device to, on the GPU where there is one (`make test-gpu`)."""

import dataclasses
import importlib.metadata
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from bench.gpu import gpu_check, trial
from ddf.training import training_loop

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
            plain = [line for line in found[key].requires or [] if "extra ==" not in line]
            _needs([re.split(r"[<>=!~;\[( ]", line)[0] for line in plain], found)
    return found


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
        *(f"{model} step, {precision}" for model in ("ddf", "pcsiren") for precision in gpu_check.PRECISIONS),
        "ddf step, tf32, without data on the device",
        "ddf step, tf32, without compiled passes",
    ]
    assert len(record["clouds"]) == 1 and all(row["median_s"] > 0 for row in record["clouds"])
    assert all(row["kernels"] > 0 and row["median_s"] > 0 and row["loss"] > 0 for row in record["steps"])
    text = (tmp_path / "gpu" / "check.md").read_text()
    assert text.count("| ddf step, ") == (len(gpu_check.PRECISIONS) + 2) and "on the CPU alone" in text


def test_differences_are_relative_and_of_the_same_parameters():
    truth = (2.0, {"a": torch.tensor([3.0, 0.0]).double(), "b": torch.tensor([4.0]).double()})
    own = (2.02, {"a": torch.tensor([3.0, 0.5]).double(), "b": torch.tensor([4.0]).double()})
    found = gpu_check.differences(own, truth)
    assert found["loss_relative"] == pytest.approx(0.01)
    assert found["gradient_relative"] == pytest.approx(0.1)
    assert found["worst_parameter_relative"] == pytest.approx(0.5 / 3)
    assert found["gradient_cosine"] == pytest.approx(25 / (5 * 25.25**0.5))
    with pytest.raises(ValueError, match=r"other parameters: \['b'\]"):
        gpu_check.differences((2.0, {"a": own[1]["a"]}), truth)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("model", ["ddf", "pcsiren"])
def test_loss_and_gradients_are_those_of_the_cpu(model, device):
    how = gpu_check.tiny()
    truth = gpu_check.gradients(how, model, "cpu", "float32")
    assert float(truth[1]["shape_encoder.fc.weight"].norm()) > 0
    exact = gpu_check.differences(gpu_check.gradients(how, model, device, "float32"), truth)
    assert exact["loss_relative"] < 1e-5 and exact["gradient_relative"] < 1e-4


def _trained(how, model, device, steps, folder, stop_at=None):
    """Weights after so many steps, written to a folder; a stopped training raises KeyboardInterrupt."""
    loop = dataclasses.replace(how.train.loop, checkpoint_seconds=0.0)
    with gpu_check.placed(device):
        training_loop.prepare(loop)
        made = trial.trial(dataclasses.replace(how.train, loop=loop), how.sections[model])

        def loss(step):
            if step == stop_at:
                raise KeyboardInterrupt
            return made.loss(step)

        groups = made.model.parameter_groups()
        training_loop.fit(made.model, groups, loss, steps, loop, folder, {"fingerprint": "x"}, model)
        return {name: value.detach().cpu().double() for name, value in made.model.named_parameters()}


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("model", ["ddf", "pcsiren"])
def test_steps_and_a_resumed_training_are_those_of_the_cpu(model, device, tmp_path):
    how = gpu_check.tiny()
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
def test_hits_of_a_cloud_are_those_of_the_cpu(device):
    how = gpu_check.tiny()
    off = (gpu_check.hits(how, device) - gpu_check.hits(how, "cpu")).norm(dim=-1)
    assert float(off.median()) < 1e-5 and float((off > 1e-3).double().mean()) < 0.02
