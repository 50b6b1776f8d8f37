"""The loop: resuming, clocks, averages, precision, and the plateau schedule."""

import dataclasses
import functools
import itertools

import numpy as np
import pytest
import torch
from _support import damage, stopped
from torch import nn

from ddf.core import checks, storage
from ddf.fields import model_files, siren
from ddf.models import loop_config
from ddf.training import training_loop

CONFIG = loop_config.LoopConfig(1e-2, "cosine", 3, 1.0, 1, 0, 4, 0.0)
RECORD = {"fingerprint": "abc", "seed": 0}


def _problem():
    torch.manual_seed(0)
    network = siren.SineNetwork(3, siren.SineLayout((6, 5, 4)), 8)
    model = nn.Sequential(network, nn.BatchNorm1d(8), nn.Linear(8, 1))

    def step_loss(step):
        random = np.random.default_rng((0, step))
        x = torch.from_numpy(random.standard_normal((16, 3)).astype(np.float32))
        loss = (model(x)[:, 0] - x.sum(-1)).square().mean()
        return loss, {"square": loss.detach()}

    return model, step_loss


def _fit(folder, steps=20, record=RECORD, stop_at=None, config=CONFIG):
    model, step_loss = _problem()
    groups, update = [{"params": list(model.parameters())}], stopped(step_loss, stop_at)
    training_loop.fit(model, groups, update, steps, config, folder, record, "test")
    return model


@pytest.mark.parametrize("changes", [{}, {"ema": 0.9}, {"muon": 0.02}], ids=repr)
def test_interrupted_twice_gives_the_same_model_as_uninterrupted(tmp_path, changes):
    config = dataclasses.replace(CONFIG, **changes)
    _fit(tmp_path / "whole", config=config)
    for stop in (7, 13):
        with pytest.raises(KeyboardInterrupt):
            _fit(tmp_path / "parts", stop_at=stop, config=config)
    for stop in (None, 0):  # a finished training runs no step again
        _fit(tmp_path / "parts", stop_at=stop, config=config)
    for name in (model_files.MODEL, training_loop.CHECKPOINT):
        assert (tmp_path / "whole" / name).read_bytes() == (tmp_path / "parts" / name).read_bytes()
    logs = [[{**r, "seconds": 0} for r in training_loop.read_log(tmp_path / f)] for f in ("whole", "parts")]
    assert [row["step"] for row in logs[0]] == [4, 8, 12, 16, 20]
    assert logs[0] == logs[1] and logs[0][-1]["square"] == logs[0][-1]["loss"] < logs[0][0]["loss"]
    tensors, _ = storage.load_tensors(tmp_path / "parts" / training_loop.CHECKPOINT, "torch")
    assert {name.partition(".")[0] for name in tensors} - {"model", "optimiser"} == (
        {"average"} if config.ema else {"muon"} if config.muon else set()
    )


def test_saved_average_is_that_of_the_models_after_every_step(tmp_path):
    """The models themselves come from trainings without an average that end after 1, 2, ... steps."""
    constant = dataclasses.replace(CONFIG, schedule="constant")
    averaged = dataclasses.replace(constant, ema=0.3)
    trained = [_fit(tmp_path / str(steps), steps, config=constant).state_dict() for steps in (1, 2, 3, 4, 5)]
    model = _fit(tmp_path / "ema", 5, config=averaged)
    files = (tmp_path / "ema" / name for name in (model_files.MODEL, training_loop.CHECKPOINT))
    saved, checkpoint = (storage.load_tensors(file, framework="torch")[0] for file in files)
    expected = {name: value.double() for name, value in trained[0].items()}
    for k, state in enumerate(trained[1:], start=1):
        decay = min(0.3, (1 + k) / (10 + k))
        expected = {name: decay * value + (1 - decay) * state[name] for name, value in expected.items()}
    for name, value in saved.items():
        assert torch.equal(model.state_dict()[name], value)
        assert torch.equal(checkpoint[f"model.{name}"], trained[-1][name])  # trained as without an average
        if value.is_floating_point():  # the batches counted are no statistic
            torch.testing.assert_close(value.double(), expected[name], rtol=1e-5, atol=1e-7)
            assert not torch.equal(value, trained[-1][name])


def test_checkpoint_of_another_fingerprint_or_damaged_is_not_resumed(tmp_path, caplog):
    _fit(tmp_path / "a", record={**RECORD, "fingerprint": "old"})
    _fit(tmp_path / "b")
    _fit(tmp_path / "a")
    assert "made by another config, data or code; training starts afresh" in caplog.text
    assert (tmp_path / "a" / model_files.MODEL).read_bytes() == (tmp_path / "b" / model_files.MODEL).read_bytes()
    path = tmp_path / "a" / training_loop.CHECKPOINT
    damage(path)
    _fit(tmp_path / "a")
    assert str(path) in caplog.text.splitlines()[-1]
    assert (tmp_path / "a" / model_files.MODEL).read_bytes() == (tmp_path / "b" / model_files.MODEL).read_bytes()


def test_model_of_another_architecture_is_refused_by_name(tmp_path):
    _fit(tmp_path)
    other = torch.nn.Linear(3, 1)
    with pytest.raises(checks.InputError, match=r"model.safetensors: does not fit the architecture"):
        model_files.load_model(other, tmp_path)
    model, _ = _problem()
    record = model_files.load_model(model, tmp_path)
    assert record["steps"] == 20
    assert not model.training
    saved, _ = storage.load_tensors(tmp_path / model_files.MODEL, framework="torch")
    assert torch.equal(dict(model.named_parameters())["2.weight"], saved["2.weight"])


def test_loss_that_is_not_finite_stops_with_the_step(tmp_path):
    model, _ = _problem()
    groups = [{"params": list(model.parameters())}]
    with pytest.raises(FloatingPointError, match="loss is nan at step 4"):
        training_loop.fit(
            model, groups, lambda _: (next(model.parameters()).sum() * torch.nan, {}), 8, CONFIG, tmp_path, RECORD, "x"
        )


def test_rate_rises_then_falls_to_zero():
    rates = [CONFIG.rate(step, 100) for step in range(100)]
    assert rates[0] == pytest.approx(1e-2 / 3, rel=1e-3)
    assert max(rates) <= 1e-2
    assert rates[-1] < 1e-5
    assert all(a > b for a, b in itertools.pairwise(rates[3:]))
    constant = dataclasses.replace(CONFIG, schedule="constant", warmup_steps=0)
    assert {constant.rate(step, 100) for step in range(100)} == {1e-2}


def test_each_update_of_a_step_moves_what_it_has_a_gradient_in(tmp_path):
    """Two parts with a loss each, the first part updated twice a step."""
    parts = {name: nn.Linear(2, 1) for name in ("critic", "generator")}
    model, seen = nn.ModuleDict(parts), []

    def loss_of(name, step):
        seen.append({part: layer.weight.detach().clone() for part, layer in parts.items()})
        x = torch.rand((8, 2), generator=torch.Generator().manual_seed(step))
        loss = (parts[name](x)[:, 0] - x.sum(-1)).square().mean()
        return loss, {f"{name}_square": loss.detach()}

    names = ["critic", "critic", "generator"]
    groups = [{"params": list(model.parameters()), "weight_decay": 0.0, "betas": (0.0, 0.9)}]
    updates = [functools.partial(loss_of, name) for name in names]
    training_loop.fit(model, groups, updates, 8, CONFIG, tmp_path, RECORD, "duel")
    for name, (before, after) in zip(names * 8, itertools.pairwise(seen), strict=False):
        assert [part for part in before if not torch.equal(before[part], after[part])] == [name]
    tensors, _ = storage.load_tensors(tmp_path / training_loop.CHECKPOINT, "torch")
    counted = [float(value) for key, value in tensors.items() if key.endswith(".step")]
    assert sorted(counted) == [8, 8, 16, 16]  # Adam counts the updates of each part
    row = training_loop.read_log(tmp_path)[-1]
    assert list(row) == ["step", "loss", "critic_square", "generator_square", "seconds"]
    assert row["loss"] == row["generator_square"]


@pytest.mark.parametrize("matmul", ["float32", "tf32"])
def test_products_are_rounded_on_a_gpu_as_asked(monkeypatch, matmul):
    monkeypatch.setattr(model_files, "device", lambda: torch.device("cuda"))
    monkeypatch.setattr(torch.backends.cudnn, "allow_tf32", True)
    before = torch.get_float32_matmul_precision()
    try:
        training_loop.prepare(dataclasses.replace(CONFIG, matmul=matmul))
        assert torch.get_float32_matmul_precision() == ("highest" if matmul == "float32" else "high")
        assert torch.backends.cudnn.allow_tf32 == (matmul != "float32")
    finally:
        torch.set_float32_matmul_precision(before)


LOOP = loop_config.LoopConfig(1e-2, "plateau", 0, None, 1, 0, 1, 0.0)


def _rows(*means):
    """Two logged losses of each 5,000 steps, with these means."""
    return [
        {"step": 5000.0 * i + place, "loss": mean + side}
        for i, mean in enumerate(means)
        for place, side in ((2500, 0.3), (5000, -0.3))
    ]


@pytest.mark.parametrize(
    ("means", "step", "reduced"),
    [
        ((3.0, 2.0, 1.0), 15000, 0),
        ((3.0, 3.0), 9999, 0),  # the second 5,000 are not over
        ((3.0, 3.0), 10000, 1),
        ((3.0, 3.5, 2.0, 2.5, 2.4), 25000, 3),  # once for each 5,000 without a new best
        ((-3.0, -3.5, -3.2), 15000, 1),
        ((), 0, 0),
    ],
)
def test_one_reduction_for_each_5000_steps_without_a_better_mean(means, step, reduced):
    assert training_loop.plateau_reductions(_rows(*means), step) == reduced
    assert LOOP.rate(step, 10**6, reduced) == pytest.approx(1e-2 * 0.9**reduced)
