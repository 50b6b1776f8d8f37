"""The paper's way to UDF and v* of a fitted field: g_v, trained once against the field, which stays as it is.

[DDF22] app. D: Adam at 1e-4, 1e4 iterations of 4,096 points p ~ U[B], for every field anew.
"""

from dataclasses import dataclass
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from ddf.core import provenance, seeding
from ddf.fields import field_values, model_files, pddf, siren, udf
from ddf.fields.shape_field import ShapeField
from ddf.models import loop_config
from ddf.training import training_loop


@dataclass(frozen=True)
class CandidateConfig:
    """How g_v is trained; the defaults are the paper's, but for the loop's bookkeeping.

    points: of a step. omega_first: bandwidth of g_v in p; the paper gives none.
    """

    loop: loop_config.LoopConfig
    steps: int = 10_000
    points: int = 4096
    hidden: tuple[int, ...] = udf.PAPER_LAYOUT.hidden
    omega_first: float = 1.0

    def network(self) -> udf.CandidateNetwork:
        """A fresh g_v."""
        return udf.CandidateNetwork(siren.SineLayout(self.hidden, self.omega_first))


def asked(field: pddf.PDDF) -> udf.Ask:
    """A field as `udf` asks it: inside its box, field frame, differentiable."""

    def ask(positions: Float[Tensor, "*n 3"], directions: Float[Tensor, "*n 3"], normals: bool) -> udf.Answer:
        outputs = ("visibility", "depth", "normals") if normals else ("visibility", "depth")
        flat = positions.reshape(-1, 3), directions.reshape(-1, 3)
        found = field_values.evaluate(field, *flat, outputs)
        where = positions.shape[:-1]
        return udf.Answer(**{name: value.reshape(*where, *value.shape[1:]) for name, value in found.items()})

    return ask


def fit(shape: ShapeField, config: CandidateConfig, out_dir: Path) -> udf.CandidateNetwork:
    """Train g_v for a field and write it to `out_dir`; a training that was stopped goes on there."""
    training_loop.prepare(config.loop)
    network, field = config.network().to(model_files.device()), shape.field.to(model_files.device())
    for value in field.parameters():
        value.requires_grad_(False)
    weight = network.network.head.weight
    lower, upper = (torch.from_numpy(side).to(weight) for side in (shape.lower, shape.upper))

    def step_loss(step: int) -> tuple[Tensor, dict[str, Tensor]]:
        generator = torch.Generator().manual_seed(seeding.numbered(config.loop.seed, step))
        share = torch.rand((config.points, 3), generator=generator).to(weight)
        positions = lower + share * (upper - lower)
        value = udf.loss(asked(field), positions, network(positions))
        return value, {}

    facts = [config, shape.record]
    record = provenance.record(facts, config.loop.seed, (), __name__) | {"kind": "closest_candidates"}
    groups = [{"params": list(network.parameters()), "weight_decay": 0.0}]  # so that AdamW is Adam
    training_loop.fit(network, groups, step_loss, config.steps, config.loop, out_dir, record, "g_v")
    return network.eval().requires_grad_(False)
