"""One training loop: a step that depends on its number alone, checkpoints, a log, and the same result after any kill.

The loss of step k draws its batch from generators seeded with (seed, k), so a run resumed at step k goes on exactly as
an uninterrupted one would (same machine kind, same number of threads and processes).
"""

import csv
import io
import logging
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar

import torch
import torch.utils.deterministic
import tqdm
from torch import Tensor, nn
from torch.optim import swa_utils

from ddf.core import checks, distributed, interrupts, schema, storage
from ddf.core.schema import fixed, setting
from ddf.fields import passes
from ddf.training import optimisers, plateau

LOGGER = logging.getLogger(__name__)
CHECKPOINT, MODEL, LOG = "checkpoint.safetensors", "model.safetensors", "log.csv"

Model = TypeVar("Model", bound=nn.Module)
StepLoss = Callable[[int], tuple[Tensor, dict[str, Tensor]]]


@dataclass(frozen=True)
class Clock:
    """A budget of wall time for all steps together, in place of their number: the schedule follows the time spent, so
    that it ends with the budget however busy the machine is. Not reproducible.
    """

    seconds: float


@dataclass(frozen=True)
class LoopConfig(schema.Checked):
    """How a model is optimised, with AdamW and Muon (`optimisers`).

    matmul: how large products of matrices are made, around parameters and sums in float32. `tf32`: on a GPU with its
      ten-bit factors, convolutions too, on a CPU as float32. `bfloat16`: those between sine layers of the shape loss
      (`passes`) and those of Muon, the others as of `tf32`; on a processor without such products all in float32.
    ema: the average is then the model that is saved; of early steps its decay is (1 + k) / (10 + k) where that is less,
      so that the start is forgotten.
    log_every: steps between two rows of the log; None: 50, a thousandth of more than 50,000, a sixth of fewer than 300.
    checkpoint_seconds: between two checkpoints; times those that writing one takes, where these are more than one.
    """

    learning_rate: float = setting(1e-4, "AdamW's learning rate", "app. singlefits", above=0)
    schedule: Literal["constant", "plateau", "cosine"] = setting(
        "plateau", "course of all rates: constant, plateau (times 0.9) or cosine to zero at the end", "app. singlefits"
    )
    warmup_steps: int = setting(0, "steps in which the rates rise from zero", least=0)
    clip_norm: float | None = setting(None, "length to which longer gradients are cut; null: any", above=0)
    threads: int = setting(8, "CPU threads of each process; part of the result, for sums are ordered by it", least=1)
    seed: int = fixed(0, least=0)
    log_every: int | None = fixed(None, least=1)
    checkpoint_seconds: float = fixed(30.0, least=0)
    matmul: passes.Matmul = setting("float32", "precision of the factors of matrix products; tf32 for a GPU")
    ema: float | None = setting(None, "decay of a moving average of the weights; null: none", above=0, below=1)
    muon: float | None = setting(
        None, "Muon's learning rate for the matrices between hidden layers; null: AdamW", "app. si3dr", above=0
    )
    muon_kernels: float | None = setting(
        None, "Muon's for the kernels of convolutions; null: AdamW", "app. si3dr", above=0
    )

    def optimiser(self, model: nn.Module, groups: list[dict]) -> optimisers.Optimiser:
        """A fresh one of the model, of these parameter groups."""
        return optimisers.Optimiser(model, groups, self.learning_rate, self.muon, self.muon_kernels, self.matmul)

    def rate(self, step: int, steps: int, reductions: int = 0) -> float:
        """AdamW's learning rate in step `step` (from 0) of `steps`; Muon's keeps its ratio to it.

        Args:
          reductions: of a schedule by plateau, see `plateau.reductions`.
        """
        rise = min(1.0, (step + 1) / self.warmup_steps) if self.warmup_steps else 1.0
        if self.schedule != "cosine":
            return self.learning_rate * rise * plateau.FACTOR**reductions
        return self.learning_rate * rise * 0.5 * (1 + math.cos(math.pi * step / steps))


def device() -> torch.device:
    """CUDA when there is one, else the CPU; of several GPUs the process's own."""
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")


def prepare(config: LoopConfig, batch_size: int | None = None) -> None:
    """Fix threads, seed and the precision of products; on the CPU only deterministic operators are allowed.

    Args:
      batch_size: images of a step, of which every process takes a part; None for work that one process does.
    Raises:
      InputError: several processes were started for such work, or cannot share the images equally.
    """
    if batch_size is None and distributed.launched() > 1:
        raise checks.InputError(f"this runs on one process; got {distributed.launched()}: leave out torchrun (LAUNCH)")
    if batch_size is not None:
        distributed.part(batch_size)
    torch.set_num_threads(config.threads)
    torch.manual_seed(config.seed)
    if config.matmul == "bfloat16" and not passes.has_bfloat16(device()):
        LOGGER.warning("this processor has no products of bfloat16: they are made in float32 (loop.matmul)")
    if device().type == "cpu":
        torch.use_deterministic_algorithms(True)
        # a step writes all that it reads
        torch.utils.deterministic.fill_uninitialized_memory = False  # pyright: ignore[reportAttributeAccessIssue]
    else:
        torch.set_float32_matmul_precision("highest" if config.matmul == "float32" else "high")
        torch.backends.cudnn.allow_tf32 = config.matmul != "float32"  # convolutions: on, if nobody says so
        torch.backends.cuda.matmul.allow_bf16_reduced_precision_reduction = False  # sums stay in float32


def fit(
    model: nn.Module,
    groups: list[dict],
    step_loss: StepLoss | Sequence[StepLoss],
    steps: int | Clock,
    config: LoopConfig,
    out_dir: Path,
    record: dict,
    describe: str,
) -> tuple[int, float]:
    """Optimise `model`, resuming from `out_dir` if its checkpoint has the same fingerprint; write model and log there.

    Of several processes (`distributed`) the first one writes; the others need to read the same folder. With
    `config.ema` the file holds the average, and so does `model` in the end.

    Args:
      groups: the optimiser's parameter groups.
      step_loss: step number to loss and terms for the log; means over the part of the batch that is the process's. Of
        several, such as those of a GAN's critic and generator, each is followed by an update of the parameters that it
        has a gradient in; the log has the terms of all and the last one's loss.
      steps: how many, or for how long (of one process alone).
      record: metadata of the model file; `record["fingerprint"]` decides whether a checkpoint may be resumed.
    Returns:
      Steps and seconds of all runs that led to the model.
    Raises:
      Interrupted: SIGINT or SIGTERM came; the first process has written a checkpoint, from which the next call goes on.
      FloatingPointError: the loss is not finite; says at which step, and that the last checkpoint is whole.
      InputError: processes differ in data, config or checkpoint.
    """
    first = distributed.rank() == 0
    updates = [step_loss] if callable(step_loss) else step_loss
    distributed.share_batch_statistics(model)
    optimiser = config.optimiser(model, groups)
    average = _average(model, config)
    start, rows, spent = _resume(model, average, optimiser, out_dir, record["fingerprint"])
    distributed.check_same(f"{out_dir}: data, config or checkpoint", f"{record['fingerprint']} at step {start}")
    done = start
    saved_at, saving = time.monotonic(), 1.0
    began = saved_at - spent
    log_every = config.log_every or (
        50 if isinstance(steps, Clock) else max(1, min(steps // 6, max(50, steps // 1000)))
    )
    progress = _progress(steps, start, describe, disable=not first)
    model.train()
    reduced = 0
    for step, signal in interrupts.counted(start):
        spent = time.monotonic() - began
        if _is_over(steps, step, spent):
            break
        if config.schedule == "plateau" and (step == start or step % plateau.APART == 0):
            reduced = plateau.reductions(rows, step)
        optimiser.set_rate(config.rate(step, _horizon(steps, step, spent), reduced))
        terms: dict[str, Tensor] = {}
        for update in updates:
            loss, found = update(step)
            terms |= {"loss": loss.detach(), **found}
            optimiser.zero_grad()
            loss.backward()
            distributed.average_gradients(model.parameters())
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
        if first and saves:
            moment = {"seconds": spent} if isinstance(steps, Clock) else {}  # equal runs by steps have equal bytes
            _save_checkpoint(model, average, optimiser, {"step": done, **moment}, rows, out_dir, record)
        if saves:
            saved_at = time.monotonic()
            saving = max(1.0, saved_at - begins)
        if last:
            break
        if signal.number:
            progress.close()
            raise interrupts.Interrupted(
                signal.number, f"step {done:,} is kept in {out_dir}; go on by:" if first else ""
            )
    progress.close()
    if average is not None:
        model.load_state_dict(average.module.state_dict())
    if first:
        storage.save_tensors(out_dir / MODEL, dict(model.state_dict()), {**record, "steps": done})
        _write_log(out_dir / LOG, rows)
    return done, spent


def _is_over(steps: int | Clock, done: int, spent: float) -> bool:
    """Whether the budget is used up; a clock gives one step at the least."""
    return done > 0 and spent >= steps.seconds if isinstance(steps, Clock) else done >= steps


def _horizon(steps: int | Clock, step: int, spent: float) -> int:
    """How many steps there will be, as far as is known before step `step`."""
    if not isinstance(steps, Clock):
        return steps
    return max(round(step * steps.seconds / spent), step + 1) if step and spent > 0 else 1 << 30


def _progress(steps: int | Clock, start: int, describe: str, disable: bool) -> tqdm.tqdm:
    """A bar of steps, or of seconds."""
    clock = isinstance(steps, Clock)
    total, unit = (round(steps.seconds), "s") if clock else (steps, "step")
    return tqdm.tqdm(
        initial=0 if clock else start, total=total, desc=describe, unit=unit, mininterval=2, disable=disable
    )


def _shown(steps: int | Clock, done: int, spent: float) -> int:
    """Where the bar stands."""
    return min(round(spent), round(steps.seconds)) if isinstance(steps, Clock) else done


def built(make: Callable[[], Model], folder: Path, beside: str | None = None) -> Model:
    """The model that `make` builds with the weights that `fit` wrote; as `load_model`.

    Sizes are compared with those of the file first: what a record claims takes no memory.
    """
    path = folder / MODEL
    found = {name: shape for name, shape in storage.shapes(path).items() if not (beside and name.startswith(beside))}
    try:
        with torch.device("meta"):
            wanted = {name: tuple(value.shape) for name, value in make().state_dict().items()}
    except checks.InputError:
        raise
    except (RuntimeError, TypeError, ValueError, OverflowError) as error:
        raise checks.InputError(f"{path}: its record describes no model ({' '.join(str(error).split())})") from error
    for name in [*wanted, *found]:
        if wanted.get(name) != found.get(name):
            raise checks.InputError(
                f"{path}: does not fit the architecture of its config: {name[:80]} is {wanted.get(name, 'no part')} "
                f"there and {found.get(name, 'not')} in the file"
            )
    model = make()
    load_model(model, folder, beside)
    return model


def load_model(model: nn.Module, folder: Path, beside: str | None = None) -> dict:
    """Fill `model` from the file that `fit` wrote, and return its record; the model is left in evaluation mode.

    Args:
      beside: how the names of tensors begin that are no weights.
    Raises:
      InputError: the file is damaged, holds another architecture, or a weight that is not finite.
    """
    path = folder / MODEL
    tensors, record = storage.load_tensors(path, framework="torch")
    try:
        model.load_state_dict({k: v for k, v in tensors.items() if beside is None or not k.startswith(beside)})
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        raise checks.InputError(f"{path}: does not fit the architecture of its config: {reason}") from error
    for name, value in tensors.items():
        if value.is_floating_point() and not bool(torch.isfinite(value).all()):
            raise checks.InputError(f"{path}: {name[:80]} holds values that are not finite; fit or train it again")
    model.to(device()).eval()
    return record


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
    values = {name: float(value) for name, value in distributed.means(terms).items()}
    if not math.isfinite(values["loss"]):
        raise FloatingPointError(f"loss is {values['loss']} at step {step}; the last checkpoint in {out_dir} is whole")
    return {"step": float(step), **values, "seconds": seconds}


def _average(model: nn.Module, config: LoopConfig) -> swa_utils.AveragedModel | None:
    """The moving average of parameters and buffers, which starts as the model after its first step; None for none."""
    decay = config.ema
    if decay is None:
        return None

    def mix(averaged: swa_utils.PARAM_LIST, current: swa_utils.PARAM_LIST, step: Tensor | int) -> None:
        early = (1 + int(step)) / (10 + int(step))
        swa_utils.get_ema_multi_avg_fn(min(decay, early))(averaged, current, step)

    return swa_utils.AveragedModel(model, multi_avg_fn=mix, use_buffers=True)


def _save_checkpoint(
    model: nn.Module,
    average: swa_utils.AveragedModel | None,
    optimiser: optimisers.Optimiser,
    state: dict[str, Any],
    rows: list[dict],
    out_dir: Path,
    record: dict,
) -> None:
    """The log first: rows past the checkpoint's step are dropped on resuming, missing ones could not be made up."""
    tensors = {f"model.{name}": value for name, value in model.state_dict().items()}
    if average is not None:
        tensors |= {f"average.{name}": value for name, value in average.state_dict().items()}
    tensors |= dict(optimiser.tensors())
    _write_log(out_dir / LOG, rows)
    storage.save_tensors(out_dir / CHECKPOINT, tensors, {**state, "fingerprint": record["fingerprint"]})


def _resume(
    model: nn.Module,
    average: swa_utils.AveragedModel | None,
    optimiser: optimisers.Optimiser,
    out_dir: Path,
    fingerprint: str,
) -> tuple[int, list[dict], float]:
    """Step to go on from, log and seconds so far; (0, [], 0) where there is nothing to resume."""
    path = out_dir / CHECKPOINT
    if not path.exists():
        return 0, [], 0.0
    try:
        tensors, metadata = storage.load_tensors(path, framework="torch")
    except checks.InputError as error:
        LOGGER.warning("%s; training starts afresh", error)
        return 0, [], 0.0
    if metadata["fingerprint"] != fingerprint:
        LOGGER.warning("%s: made by another config, data or code; training starts afresh", path)
        return 0, [], 0.0
    model.load_state_dict(_under("model.", tensors))
    if average is not None:
        average.load_state_dict(_under("average.", tensors))
    optimiser.load(tensors)
    LOGGER.info("%s: resuming at step %d", path, metadata["step"])
    rows = [row for row in read_log(out_dir) if row["step"] <= metadata["step"]]
    return metadata["step"], rows, metadata.get("seconds", rows[-1]["seconds"] if rows else 0.0)


def _under(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}
