"""One training loop: a step that depends on its number alone, checkpoints, a log, and the same result after any kill.

The loss of step k draws its batch from generators seeded with (seed, k), so a run resumed at step k goes on exactly as
an uninterrupted one would (same machine kind, same number of threads and processes).
"""

import csv
import io
import logging
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import torch.utils.deterministic
import tqdm
from torch import Tensor, nn
from torch.optim import swa_utils

from ddf.core import checks, processes, storage
from ddf.fields import model_files
from ddf.models import loop_config
from ddf.training import optimisers

LOGGER = logging.getLogger(__name__)
CHECKPOINT, LOG = "checkpoint.safetensors", "log.csv"
PLATEAU_STEPS, PLATEAU_SHARE = 5000, 1e-4

StepLoss = Callable[[int], tuple[Tensor, dict[str, Tensor]]]


def prepare(config: loop_config.LoopConfig) -> None:
    """Fix threads, seed and the precision of products; on the CPU only deterministic operators are allowed."""
    torch.set_num_threads(config.threads)
    torch.manual_seed(config.seed)
    if model_files.device().type == "cpu":
        torch.use_deterministic_algorithms(True)
        # a step writes all that it reads
        torch.utils.deterministic.fill_uninitialized_memory = False  # pyright: ignore[reportAttributeAccessIssue]
    else:
        torch.set_float32_matmul_precision("highest" if config.matmul == "float32" else "high")
        torch.backends.cudnn.allow_tf32 = config.matmul != "float32"  # convolutions: on, if nobody says so


def fit(
    model: nn.Module,
    groups: list[dict],
    step_loss: StepLoss | Sequence[StepLoss],
    steps: int | loop_config.Clock,
    config: loop_config.LoopConfig,
    out_dir: Path,
    record: dict,
    describe: str,
) -> tuple[int, float]:
    """Optimise `model`, resuming from `out_dir` if its checkpoint has the same fingerprint; write model and log there.

    With `config.ema` the file holds the average, and so does `model` in the end.

    Args:
      groups: the optimiser's parameter groups.
      step_loss: step number to loss and terms for the log; means over the batch. Of several, such as those of a
        GAN's critic and generator, each is followed by an update of the parameters that it has a gradient in; the log
        has the terms of all and the last one's loss.
      steps: how many, or for how long.
      record: metadata of the model file; `record["fingerprint"]` decides whether a checkpoint may be resumed.
    Returns:
      Steps and seconds of all runs that led to the model.
    Raises:
      Interrupted: SIGINT or SIGTERM came; a checkpoint is written, from which the next call goes on.
      FloatingPointError: the loss is not finite; says at which step, and that the last checkpoint is whole.
    """
    updates = [step_loss] if callable(step_loss) else step_loss
    optimiser = optimisers.Optimiser(model, groups, config)
    average = _average(model, config)
    checkpoint = _Checkpoint(out_dir, record["fingerprint"], model, average, optimiser)
    start, rows, spent = checkpoint.resume()
    done = start
    saved_at, saving = time.monotonic(), 1.0
    began = saved_at - spent
    log_every = config.log_every or (
        50 if isinstance(steps, loop_config.Clock) else max(1, min(steps // 6, max(50, steps // 1000)))
    )
    progress = _progress(steps, start, describe)
    model.train()
    reduced = 0
    for step, signal in processes.counted(start):
        spent = time.monotonic() - began
        if _is_over(steps, step, spent):
            break
        if config.schedule == "plateau" and (step == start or step % PLATEAU_STEPS == 0):
            reduced = plateau_reductions(rows, step)
        optimiser.set_rate(config.rate(step, _horizon(steps, step, spent), reduced))
        terms: dict[str, Tensor] = {}
        for update in updates:
            loss, found = update(step)
            terms |= {"loss": loss.detach(), **found}
            optimiser.zero_grad()
            loss.backward()
            if config.clip_norm is not None:
                nn.utils.clip_grad_norm_(model.parameters(), config.clip_norm)
            optimiser.step()
        if average is not None:
            average.update_parameters(model)
        done = step + 1
        spent = time.monotonic() - began
        last = _is_over(steps, done, spent)
        saves = last or bool(signal.number) or time.monotonic() - saved_at >= config.checkpoint_seconds * saving
        if done % log_every == 0 or last:
            rows.append(_log_row(done, terms, spent, out_dir))
            progress.set_postfix(loss=f"{rows[-1]['loss']:.3f}", refresh=False)
        progress.update(_shown(steps, done, spent) - progress.n)
        begins = time.monotonic()
        if saves:
            # equal runs by steps have equal bytes
            checkpoint.save(rows, {"seconds": spent} if isinstance(steps, loop_config.Clock) else {}, done)
            saved_at = time.monotonic()
            saving = max(1.0, saved_at - begins)
        if last:
            break
        if signal.number:
            progress.close()
            raise processes.Interrupted(signal.number, f"step {done:,} is kept in {out_dir}; go on by:")
    progress.close()
    if average is not None:
        model.load_state_dict(average.module.state_dict())
    storage.save_tensors(out_dir / model_files.MODEL, dict(model.state_dict()), {**record, "steps": done})
    _write_log(out_dir / LOG, rows)
    return done, spent


def _is_over(steps: int | loop_config.Clock, done: int, spent: float) -> bool:
    """Whether the budget is used up; a clock gives one step at the least."""
    return done > 0 and spent >= steps.seconds if isinstance(steps, loop_config.Clock) else done >= steps


def _horizon(steps: int | loop_config.Clock, step: int, spent: float) -> int:
    """How many steps there will be, as far as is known before step `step`."""
    if not isinstance(steps, loop_config.Clock):
        return steps
    return max(round(step * steps.seconds / spent), step + 1) if step and spent > 0 else 1 << 30


def _progress(steps: int | loop_config.Clock, start: int, describe: str) -> tqdm.tqdm:
    """A bar of steps, or of seconds."""
    clock = isinstance(steps, loop_config.Clock)
    total, unit = (round(steps.seconds), "s") if clock else (steps, "step")
    return tqdm.tqdm(initial=0 if clock else start, total=total, desc=describe, unit=unit, mininterval=2)


def _shown(steps: int | loop_config.Clock, done: int, spent: float) -> int:
    """Where the bar stands."""
    return min(round(spent), round(steps.seconds)) if isinstance(steps, loop_config.Clock) else done


def plateau_reductions(rows: Sequence[Mapping[str, float]], step: int) -> int:
    """How often the paper's schedule reduced the rate before step `step` (from 0), by the rows of the log up to then.

    The rate becomes 0.9 times what it was where the loss stays, at least 5,000 steps apart ([DDF22] app. `singlefits`;
    what counts as a plateau is not given). Here it is a mean logged loss of 5,000 steps that is not below the least one
    before by `PLATEAU_SHARE`, as in torch's `ReduceLROnPlateau`. The log alone decides, so a resumed training goes on
    alike.
    """
    steps, losses = (np.array([row[name] for row in rows]) for name in ("step", "loss"))
    best, reduced = math.inf, 0
    for window in range(step // PLATEAU_STEPS):
        inside = (steps > window * PLATEAU_STEPS) & (steps <= (window + 1) * PLATEAU_STEPS)
        if inside.any():
            loss = float(losses[inside].mean())
            falls = loss < best * (1 - PLATEAU_SHARE)
            best, reduced = loss if falls else best, reduced + (not falls)
    return reduced


def read_log(folder: Path) -> list[dict[str, float]]:
    """Rows of the log that `fit` wrote: step, loss, its terms, seconds since the start; empty where there is none."""
    path = folder / LOG
    if not path.exists():
        return []
    rows = csv.DictReader(io.StringIO(path.read_text(encoding="utf-8")))
    return [{name: float(value) for name, value in row.items()} for row in rows]


def _write_log(path: Path, rows: list[dict[str, float]]) -> None:
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(rows[0]) if rows else ["step"], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    storage.write_text(path, text.getvalue())


def _log_row(step: int, terms: dict[str, Tensor], seconds: float, out_dir: Path) -> dict[str, float]:
    values = {name: float(value) for name, value in terms.items()}
    if not math.isfinite(values["loss"]):
        raise FloatingPointError(f"loss is {values['loss']} at step {step}; the last checkpoint in {out_dir} is whole")
    return {"step": float(step), **values, "seconds": seconds}


def _average(model: nn.Module, config: loop_config.LoopConfig) -> swa_utils.AveragedModel | None:
    """The moving average of parameters and buffers, which starts as the model after its first step; None for none."""
    decay = config.ema
    if decay is None:
        return None

    def mix(averaged: swa_utils.PARAM_LIST, current: swa_utils.PARAM_LIST, step: Tensor | int) -> None:
        early = (1 + int(step)) / (10 + int(step))
        swa_utils.get_ema_multi_avg_fn(min(decay, early))(averaged, current, step)

    return swa_utils.AveragedModel(model, multi_avg_fn=mix, use_buffers=True)


@dataclass(frozen=True)
class _Checkpoint:
    """What a training goes on from, in its folder."""

    folder: Path
    fingerprint: str
    model: nn.Module
    average: swa_utils.AveragedModel | None
    optimiser: optimisers.Optimiser

    @property
    def _modules(self) -> dict[str, nn.Module]:
        return {"model.": self.model} | ({} if self.average is None else {"average.": self.average})

    def save(self, rows: list[dict], state: Mapping[str, Any], step: int) -> None:
        """The log first: rows past the checkpoint's step are dropped on resuming, missing ones could not be made up."""
        tensors = {
            prefix + name: value for prefix, own in self._modules.items() for name, value in own.state_dict().items()
        }
        _write_log(self.folder / LOG, rows)
        metadata = {"step": step, **state, "fingerprint": self.fingerprint}
        storage.save_tensors(self.folder / CHECKPOINT, tensors | dict(self.optimiser.tensors()), metadata)

    def resume(self) -> tuple[int, list[dict], float]:
        """Step to go on from, log and seconds so far; (0, [], 0) where there is nothing to resume."""
        path = self.folder / CHECKPOINT
        if not path.exists():
            return 0, [], 0.0
        try:
            tensors, metadata = storage.load_tensors(path, framework="torch")
        except checks.InputError as error:
            LOGGER.warning("%s; training starts afresh", error)
            return 0, [], 0.0
        if metadata["fingerprint"] != self.fingerprint:
            LOGGER.warning("%s: made by another config, data or code; training starts afresh", path)
            return 0, [], 0.0
        for prefix, own in self._modules.items():
            names = [name for name in tensors if name.startswith(prefix)]
            own.load_state_dict({name.removeprefix(prefix): tensors[name] for name in names})
        self.optimiser.load(tensors)
        LOGGER.info("%s: resuming at step %d", path, metadata["step"])
        rows = [row for row in read_log(self.folder) if row["step"] <= metadata["step"]]
        return metadata["step"], rows, metadata.get("seconds", rows[-1]["seconds"] if rows else 0.0)
