"""The paper's course of the learning rate: 0.9 times what it was where the loss stays, at least 5,000 steps apart.

Source: [DDF22] app. `singlefits`; what counts as a plateau is not given. Here the mean logged loss of each 5,000 steps
goes to torch's `ReduceLROnPlateau` with no patience. The log alone decides, so a resumed training goes on alike.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import torch

from ddf.models import loop_config

APART = 5000  # steps


def reductions(rows: Sequence[Mapping[str, float]], step: int) -> int:
    """How often the rate was reduced before step `step` (from 0), by the rows of the log up to then."""
    whole = step // APART
    steps = np.array([row["step"] for row in rows])
    losses = np.array([row["loss"] for row in rows])
    dummy = torch.optim.SGD([torch.zeros(1)], lr=1.0)
    scheduler = torch.optim.lr_scheduler.ReduceLROnPlateau(dummy, factor=loop_config.PLATEAU_FACTOR, patience=0)
    reduced = 0
    for window in range(whole):
        inside = (steps > window * APART) & (steps <= (window + 1) * APART)
        if inside.any():
            before = dummy.param_groups[0]["lr"]
            scheduler.step(float(losses[inside].mean()))
            reduced += dummy.param_groups[0]["lr"] < before
    return reduced
