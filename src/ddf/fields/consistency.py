"""Losses for what only a true DDF satisfies, off by default: view consistency and gradient consistency.

  view      a surface point q_1 is seen from every p_2, or something before it: with t = |q_1 - p_2| and
            v_2 = (q_1 - p_2)/t, ξ(p_2, v_2) = 1 and d(p_2, v_2) <= t              [DDF22] app. `viewconsis`
  gradient  (∇_v d - d ∇_p d)(I - v vᵀ) = 0                                        [DDF22] §3.1, Property III

`shape.field_diagnostics` measures the same residuals of a fitted field.
"""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ddf.fields import derivatives, pddf

SHORTEST = 1e-3  # field units: nearer starts have no direction that float32 can tell
BEYOND = 2.0  # weight of a depth too far, a field unit of it, beside the cross-entropy of visibility


def view_loss(
    field: pddf.PDDF,
    surface_points: Float[Tensor, "*shapes n 3"],
    starts: Float[Tensor, "*shapes n 3"],
    visible: Float[Tensor, "*shapes n"],
    modulations: Sequence[Tensor] | None = None,
) -> Float[Tensor, ""]:
    """Mean over n of ξ_1 (BCE(ξ(p_2, v_2), 1) + `BEYOND` max(0, d(p_2, v_2) - t)).

    Source: the inequality is that of [DDF22] app. `viewconsis`; as a loss it is derived here, linear in the depth
    because most violations are small. One query a point.

    Args:
      surface_points: q_1, field frame; anything where nothing is visible. starts: p_2, anywhere in the box.
      visible: ξ_1, 1 where q_1 lies on the surface and 0 where the first ray met nothing.
    """
    way = surface_points - starts
    t = way.norm(dim=-1)
    counted = visible * (t > SHORTEST)
    raw = field(starts, way / t.clamp_min(SHORTEST)[..., None], None if modulations is None else list(modulations))
    beyond = BEYOND * torch.relu(field.depth(raw) - t)
    hidden = nn.functional.softplus(-raw[..., pddf.VISIBILITY_ROW])  # BCE against 1
    return (counted * (hidden + beyond)).sum() / max(1, counted.numel())


def gradient_loss(
    field: pddf.PDDF,
    positions: Float[Tensor, "*shapes n 3"],
    directions: Float[Tensor, "*shapes n 3"],
    visible: Float[Tensor, "*shapes n"],
    modulations: Sequence[Tensor] | None = None,
) -> Float[Tensor, ""]:
    """Mean over n of ξ ‖(∇_v d - d ∇_p d)(I - v vᵀ)‖² of the heavier component. Source: [DDF22] §3.1, Property III.

    One forward pass, and one adjoint pass that gives both gradients.
    """
    trace = derivatives.trace(field.network, field.inputs(positions, directions), modulations)
    rows = pddf.heavier_rows(trace.outputs)
    slope = (rows * field.depth_slopes(trace.outputs)).sum(-1, keepdim=True)
    both = slope * derivatives.adjoint(field.network, trace.slopes, rows, derivatives.POSITION_AND_DIRECTION)
    in_p, in_v = both.split(3, dim=-1)
    mismatch = in_v - field.depth(trace.outputs)[..., None] * in_p
    across = mismatch - (mismatch * directions).sum(-1, keepdim=True) * directions
    return (visible * across.square().sum(-1)).sum() / max(1, visible.numel())
