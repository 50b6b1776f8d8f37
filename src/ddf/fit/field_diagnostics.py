"""How far a fitted field is from being a DDF at all: identities that hold for every exact one, measured on random rays.

None of them needs the shape. All are in the field frame; a residual is 0 for an exact field, away from grazing rays,
whose derivatives grow without bound. Seen: visibility of at least 1/2.

  directed eikonal      |∇_p d · v + 1| where something is seen, |∇_p ξ · v| everywhere   [DDF22] §3.1, Property I
  gradient consistency  ‖(∇_v d - d ∇_p d)(I - v vᵀ)‖ where something is seen            [DDF22] §3.1, Property III
  view consistency      for q_1 = p_1 + d v_1 seen from (p_1, v_1) and p_2 + t v_2 = q_1, t > 0:
                        max(0, d(p_2, v_2) - t) and 1 - ξ(p_2, v_2)                      [DDF22] app. `viewconsis`
"""

import math
from collections.abc import Callable

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ddf.fields.framed_field import CHUNK_RAYS, SEEN
from ddf.fields.pddf import visibility
from ddf.fields.shape_field import ShapeField
from ddf.geometry import rays

NAMES = ("eikonal_depth", "eikonal_visibility", "gradient_consistency", "view_depth", "view_visibility")

# (positions, directions) to (depth, visibility), differentiable in both
Answers = Callable[[Float[Tensor, "n 3"], Float[Tensor, "n 3"]], tuple[Float[Tensor, "n"], Float[Tensor, "n"]]]


def measure(shape: ShapeField, count: int, seed: int = 0) -> dict[str, dict[str, float]]:
    """Median, 95 % and worst of every residual of `NAMES`, and of how many rays, over random rays of the box:
    p ~ U[B], v ~ U[S²], and second starts p_2 ~ U[B].
    """
    weight = shape.field.network.head.weight

    def answers(positions: Tensor, directions: Tensor) -> tuple[Tensor, Tensor]:
        raw = shape.field(positions, directions)
        return shape.field.depth(raw), visibility(raw)

    random = np.random.default_rng(seed)
    drawn = [random.uniform(shape.lower, shape.upper, (count, 3)) for _ in range(2)]
    drawn.append(random.standard_normal((count, 3)))
    starts, others, along = (torch.from_numpy(values).to(weight) for values in drawn)
    directions = torch.nn.functional.normalize(along, dim=-1)
    chunks = zip(*(values.split(CHUNK_RAYS) for values in (starts, directions, others)), strict=True)
    parts = [residuals(answers, *chunk) for chunk in chunks]
    return {name: _summary(torch.cat([part[name] for part in parts])) for name in NAMES}


def residuals(
    answers: Answers, positions: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"], others: Float[Tensor, "n 3"]
) -> dict[str, Float[Tensor, "_"]]:
    """Every residual of `NAMES`, of the rays that it applies to; `others` are p_2, one for each ray."""
    p, v = positions.clone().requires_grad_(), directions.clone().requires_grad_()
    depth, seen_share = answers(p, v)
    depth_grad_p, depth_grad_v = torch.autograd.grad(depth.sum(), (p, v), retain_graph=True)
    (visibility_grad_p,) = torch.autograd.grad(seen_share.sum(), p)
    depth, seen_share, p, v = depth.detach(), seen_share.detach(), positions, directions
    seen = seen_share >= SEEN
    mismatch = depth_grad_v - depth[:, None] * depth_grad_p
    across = mismatch - (mismatch * v).sum(-1, keepdim=True) * v
    hits = rays.surface_points(p, v, depth)
    view_depth, view_visibility = view_residuals(answers, hits, others, seen)
    return {
        "eikonal_depth": ((depth_grad_p * v).sum(-1) + 1)[seen].abs(),
        "eikonal_visibility": (visibility_grad_p * v).sum(-1).abs(),
        "gradient_consistency": across[seen].norm(dim=-1),
        "view_depth": view_depth,
        "view_visibility": view_visibility,
    }


@torch.no_grad()
def view_residuals(
    answers: Answers, surface_points: Float[Tensor, "n 3"], starts: Float[Tensor, "n 3"], chosen: Bool[Tensor, "n"]
) -> tuple[Float[Tensor, "_"], Float[Tensor, "_"]]:
    """max(0, d(p_2, v_2) - t) and 1 - ξ(p_2, v_2) of the chosen points q_1, looked at from p_2.

    Source: [DDF22] app. `viewconsis`. A surface point seen once is seen from everywhere, or something before it.
    """
    q, p = surface_points[chosen], starts[chosen]
    t = (q - p).norm(dim=-1)
    depth, seen_share = answers(p, (q - p) / t.clamp_min(1e-12)[:, None])  # guards a start on the point itself
    return (depth - t).clamp_min(0.0), 1.0 - seen_share


def _summary(values: Float[Tensor, "n"]) -> dict[str, float]:
    """Median, 95 %, worst and number; NaN of nothing."""
    if not len(values):
        return {"median": math.nan, "p95": math.nan, "worst": math.nan, "rays": 0}
    median, high, worst = np.quantile(values.double().cpu().numpy(), [0.5, 0.95, 1.0])
    return {"median": float(median), "p95": float(high), "worst": float(worst), "rays": len(values)}
