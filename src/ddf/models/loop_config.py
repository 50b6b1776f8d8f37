"""How a model is optimised: settings of the training loop, and its budget of time."""

import math
from dataclasses import dataclass
from typing import Literal

from ddf.core import schema
from ddf.core.schema import fixed, setting

PLATEAU_FACTOR = 0.9  # of the rate, at a plateau of the loss


@dataclass(frozen=True)
class Clock:
    """A budget of wall time for all steps together, in place of their number: the schedule follows the time spent, so
    that it ends with the budget however busy the machine is. Not reproducible.
    """

    seconds: float


@dataclass(frozen=True)
class LoopConfig(schema.Checked):
    """How a model is optimised, with AdamW and Muon (`training.optimisers`).

    matmul: `tf32` makes products of matrices, and convolutions, with ten-bit factors on a GPU; on a CPU as float32.
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
    matmul: Literal["float32", "tf32"] = setting(
        "float32", "precision of the factors of matrix products; tf32 for a GPU"
    )
    ema: float | None = setting(None, "decay of a moving average of the weights; null: none", above=0, below=1)
    muon: float | None = setting(
        None, "Muon's learning rate for the matrices between hidden layers; null: AdamW", "app. si3dr", above=0
    )
    muon_kernels: float | None = setting(
        None, "Muon's for the kernels of convolutions; null: AdamW", "app. si3dr", above=0
    )

    def rate(self, step: int, steps: int, reductions: int = 0) -> float:
        """AdamW's learning rate in step `step` (from 0) of `steps`, after as many reductions at plateaus; Muon's keeps
        its ratio to it.
        """
        rise = min(1.0, (step + 1) / self.warmup_steps) if self.warmup_steps else 1.0
        if self.schedule != "cosine":
            return self.learning_rate * rise * PLATEAU_FACTOR**reductions
        return self.learning_rate * rise * 0.5 * (1 + math.cos(math.pi * step / steps))
