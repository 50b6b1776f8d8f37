"""Unsigned distances and the direction v* of the closest point, from a directed distance field. [DDF22] §4.2, app. D.

UDF(p) = min over visible v of d(p, v), and v*(p) is where that is reached; ∇UDF = -v*^T wherever v* is unique, that is
neither on the surface nor on its medial surface. The paper's g_v (`CandidateNetwork`), a small sine network, gives
K_c candidates, trained once per field by `loss`.

A field is asked through an `Ask`, so closed forms, plain and conditional fields and scenes all serve. Letters: n
points, k candidates; ξ visibility, d depth; η_T, ε_s as in `scene_field`.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ddf.fields import siren

SMALL_MEAN = 0.05  # a mean direction shorter than this has cancelled (a point between two sheets)
TEMPERATURE, INVERSE_DEPTH = 0.05, 0.05  # η_T and ε_s
SEEN = 0.5  # visibility from which on a depth counts
NUM_CANDIDATES = 5  # K_c. Source: [DDF22] app. D
PAPER_LAYOUT = siren.SineLayout((128,) * 5)  # of g_v. Source: [DDF22] app. D


@dataclass(frozen=True)
class Answer:
    """What a field says along rays: ξ in [0, 1], depth, and the unit normal that faces back (None where not asked)."""

    visibility: Float[Tensor, "*n"]
    depth: Float[Tensor, "*n"]
    normals: Float[Tensor, "*n 3"] | None = None


Ask = Callable[[Float[Tensor, "*n 3"], Float[Tensor, "*n 3"], bool], Answer]
"""A field as a function of positions, unit directions, and whether normals are wanted."""


@dataclass(frozen=True)
class Closest:
    """Distances to the surface and unit directions v* towards it; `inf` and 0 where no candidate sees anything."""

    distances: Float[Tensor, "n"]
    directions: Float[Tensor, "n 3"]


def closest_directions(
    candidates: Float[Tensor, "n k 3"],
    visibilities: Float[Tensor, "n k"],
    depths: Float[Tensor, "n k"],
    temperature: float,
    inverse_depth: float,
) -> Float[Tensor, "n 3"]:
    """v̂*, the normalised mean of the candidates with weights softmax_k(ξ_k / (η_T (ε_s + d_k))).

    Where the mean all but vanishes, the heaviest candidate is taken instead (derived here).

    Args:
      candidates: unit directions. depths: field units. temperature: η_T. inverse_depth: ε_s.
    """
    score = visibilities / (temperature * (inverse_depth + depths))
    weights = torch.softmax(score, dim=-1)
    mean = (weights[..., None] * candidates).sum(dim=-2)
    best = candidates[torch.arange(len(candidates), device=candidates.device), weights.argmax(dim=-1)]
    length = mean.norm(dim=-1, keepdim=True)
    return torch.where(length < SMALL_MEAN, best, mean / length.clamp_min(SMALL_MEAN))


class CandidateNetwork(nn.Module):
    """g_v: a position to K_c unit candidates for v*. Source: [DDF22] app. D."""

    def __init__(self, layout: siren.SineLayout = PAPER_LAYOUT) -> None:
        super().__init__()
        self.network = siren.SineNetwork(3, layout, 3 * NUM_CANDIDATES)

    def forward(self, positions: Float[Tensor, "*n 3"]) -> Float[Tensor, "*n k 3"]:
        """Candidates of length 1."""
        raw = self.network(positions).unflatten(-1, (NUM_CANDIDATES, 3))
        return nn.functional.normalize(raw, dim=-1)


def loss(
    ask: Ask,
    positions: Float[Tensor, "n 3"],
    candidates: Float[Tensor, "n k 3"],
    spread: float = 5e-3,
    alignment: float = 0.1,
) -> Float[Tensor, ""]:
    """L_v* = mean_i (d_i - ξ_i) + 2 τ_n/(K² - K) Σ_i Σ_{j≠i} v_i·v_j + τ_d mean_i (v_i·n_i + 1)², mean over points.

    Source: [DDF22] app. D, eq. `vstartermone` and the two terms below it.

    Args:
      spread: τ_n, which keeps candidates apart. alignment: τ_d, which makes them run against the normal.
    """
    count = candidates.shape[-2]
    answer = ask(positions.unsqueeze(-2).expand_as(candidates), candidates, True)
    assert answer.normals is not None
    near = (answer.depth - answer.visibility).mean()
    total = candidates.sum(dim=-2)
    pairs = (total * total).sum(-1) - count  # Σ_i Σ_{j≠i} v_i·v_j, for |v_i| = 1
    apart = 2 * spread / (count * count - count) * pairs.mean()
    along = ((candidates * answer.normals).sum(-1) + 1).square().mean()
    return near + apart + alignment * along


@torch.no_grad()
def from_candidates(ask: Ask, positions: Float[Tensor, "n 3"], candidates: Float[Tensor, "n k 3"]) -> Closest:
    """Distances and v* from candidates, by weights softmax(ξ_i / (η_T (ε_s + d_i))); one query a candidate.

    The distance is the least depth that is seen (derived here). The paper's, Σ w_i d_i, is too large.
    """
    answer = ask(positions.unsqueeze(-2).expand_as(candidates), candidates, False)
    directions = closest_directions(candidates, answer.visibility, answer.depth, TEMPERATURE, INVERSE_DEPTH)
    seen = answer.visibility >= SEEN
    distances = answer.depth.masked_fill(~seen, torch.inf).amin(-1)
    return Closest(distances, torch.where(seen.any(-1, keepdim=True), directions, 0.0))
