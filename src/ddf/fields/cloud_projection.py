"""Point clouds from a conditional field: project random points onto the surface, N_H times. [DDF22] §4.3, app. E.

For each p, n_v directions v_k are drawn; their weights a = softmax(ξ_k / (η_T (ε_s + d_k))) favour what is near and
visible; v̂* is the normalised weighted mean, q = p + d(p, v̂*) v̂*. The cycle repeats from p <- q. Of (1 + ε_p) n_p
points the n_p most visible are kept. B is the box. Positions are in the field frame.

Three departures are always on (derived here): a hit more than `BEYOND` outside the box has ξ = 0, every one outside it
starts the next cycle from its side, and where the weighted mean of directions all but vanishes the heaviest is taken.

Six are each off in the paper's way (derived here):
- On the surface itself depth jumps from 0 to the next surface, and a field is at its worst there. With `jitter` σ the
  next cycle starts from q + σ N(0, I), which also spreads the points by area of the surface, not by volume of the box.
- A single depth is one opinion. With `recheck` offsets s_j the field is asked again on the line of the ray, from
  q - s_j v̂* along v̂* and from q + s_j v̂* back, and q moves to the median of all answers.
- The most visible points of one cycle crowd where much of the box looks at little of the surface ("not uniform", says
  the paper), and thin parts, of which the field is less sure, get none. With `spread` p all points of the second and
  later cycles (of the first, if it is alone) are candidates, and the cloud is their farthest-point order with distances
  multiplied by c^p, where the confidence c is the mean of ξ over the hit and its rechecks: even where the field is
  sure, sparse where it doubts.
- A stray is far from all others, so such an order takes it early. With `crowding` r, for `spread` alone, the distances
  of a candidate with emptier surroundings than most are also multiplied by (s_m / s)^r, s the distance to its
  `CROWD`-th neighbour and s_m the median of these.
- Candidates of less confidence than `least_confidence`, for `spread` alone, are left out, as far as enough remain.
- Most uniform directions leave the box at once where the first cycle starts near a side of it, and with few of them
  none may meet the shape. The share `aimed` of the first cycle's directions go to random points of the box instead.

The farthest-point order is made by numpy, on a GPU by one kernel. The kernel needs Triton, which torch brings along on
Linux. Where it is missing, and for very many points, numpy orders those of a GPU too.
"""

import importlib.util
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from ddf.core import arrays, checks, schema
from ddf.core.schema import fixed, setting
from ddf.fields import udf
from ddf.fields.pddf import PDDF, visibility

OVERSAMPLING = 0.1  # ε_p
CROWD = 8  # neighbours that tell how empty a candidate's surroundings are
GROUP, SPACING_ROWS = 16, 32  # points in a group and rows at a time of `_spacing`; speed only
SPACING_VALUES = 2**27  # distances at a time of `_spacing` on a GPU
LEAST_WEIGHT = 1e-6  # of a candidate: its square is still a float32, and those of no confidence keep an order
CUBE = ((-1.0,) * 3, (1.0,) * 3)
CHUNK_RAYS = {"cpu": 2048, "cuda": 2**20}  # what stays in a CPU's cache, fills a GPU
BEYOND = 0.05  # field units: a hit so far outside the box, which holds the shape, is none; less is an error of a depth

Box = tuple[Sequence[float], Sequence[float]]  # lower and upper corner


@dataclass(frozen=True)
class CloudConfig(schema.Checked):
    """How clouds are drawn; all defaults are the paper's way."""

    num_directions: int = setting(128, "n_v, directions that a point tries", "§4.3", least=1)
    cycles: int = fixed(3, least=1)
    jitter: float = setting(0.0, "σ, field units: spread of a cycle's starts about the last hits", "§4.3", least=0)
    recheck: tuple[float, ...] = setting(
        (), "field units: offsets from which a hit is asked for again from both sides", "§4.3"
    )
    spread: float | None = setting(
        None,
        "power of the confidence that weights a farthest-point order of all candidates; null: the most visible",
        "app. si3dr",
        least=0,
    )
    temperature: float = setting(0.1, "η_T of the directions' weights", above=0)
    inverse_depth: float = setting(0.1, "ε_s of the directions' weights", above=0)
    crowding: float = setting(
        0.0, "power by which candidates with empty surroundings are taken later in that order", "app. si3dr", least=0
    )
    least_confidence: float = setting(0.0, "candidates of less are left out of it", "app. si3dr", least=0, most=1)
    aimed: float = setting(
        0.0, "share of the first cycle's directions that go to points of the box", "§4.3", least=0, most=1
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "recheck", tuple(self.recheck))
        if not all(0 < offset < 1 for offset in self.recheck):
            raise checks.InputError(f"recheck must list offsets in (0, 1); got {list(self.recheck)}")


USUAL = CloudConfig(  # of commands
    num_directions=16,
    jitter=0.2,
    recheck=(0.1,),
    spread=0.75,
    temperature=0.05,
    inverse_depth=0.05,
    crowding=1.0,
    least_confidence=0.1,
    aimed=0.5,
)


@dataclass(frozen=True)
class ProjectedPoints:
    """Points after one cycle; ξ(p, v̂*) that the field gave each; the mean of that and of the rechecks' ξ."""

    points: Float[Tensor, "n 3"]
    visibility: Float[Tensor, "n"]
    confidence: Float[Tensor, "n"]


def select(cycles: Sequence[ProjectedPoints], counts: Sequence[int], config: CloudConfig) -> list[Float[Tensor, "_ 3"]]:
    """A cloud of each size, from the cycles that `sample` projected for the largest.

    Without `spread`, the most visible points of the last cycle, among as many as a draw of that size would have made.
    With it, the first points of one order of the candidates of all sizes.
    """
    if config.spread is None:
        last = cycles[-1]
        best = (last.visibility[: num_drawn(count)].topk(count).indices for count in counts)
        return [last.points[rows] for rows in best]
    points, confidence = candidates(cycles)
    trusted = _trusted(confidence, config.least_confidence, max(counts))
    points, weights = points[trusted], confidence[trusted].pow(config.spread)
    if config.crowding:
        spacing = _spacing(points)
        usual = spacing.median()
        weights = weights * (usual / spacing.maximum(usual)).nan_to_num(nan=1.0).pow(config.crowding)
    order = farthest_point_order(points, max(counts), weights.clamp_min(LEAST_WEIGHT))
    return [points[order[:count]] for count in counts]


def draw(
    field: PDDF,
    modulations: Sequence[Float[Tensor, "1 _"]] | None,
    count: int,
    config: CloudConfig,
    generator: torch.Generator,
    box: Box = CUBE,
) -> Float[Tensor, "count 3"]:
    """One cloud: `sample` and `select`."""
    return select(sample(field, modulations, count, config, generator, box), [count], config)[0]


def candidates(cycles: Sequence[ProjectedPoints]) -> tuple[Float[Tensor, "n 3"], Float[Tensor, "n"]]:
    """All points of the second and later cycles (of the first, if it is alone), and their confidence."""
    pool = cycles[1:] or cycles
    return torch.cat([cycle.points for cycle in pool]), torch.cat([cycle.confidence for cycle in pool])


def _trusted(confidence: Float[Tensor, "n"], least: float, count: int) -> Int[Tensor, "_"]:
    """Indices in order of those of at least this confidence, or of the `count` most confident if they are fewer."""
    enough = confidence.topk(min(count, len(confidence))).values[-1]
    return (confidence >= enough.clamp_max(least)).nonzero()[:, 0]


def num_drawn(count: int) -> int:
    """(1 + ε_p) n_p, the points that are projected for a cloud of `count`, but for rounding of 1.1."""
    return math.ceil(count * (1 + OVERSAMPLING) - 1e-6)


def _spacing(points: Float[Tensor, "n 3"]) -> Float[Tensor, "n"]:
    """Distance of each point to the `CROWD`-th nearest of the others.

    It is among the points of the groups that have the nearest members. These are found first, for a minimum alone takes
    much less time than the least of many with their places; few rows at a time, which stay in the cache.
    """
    k, spare = min(CROWD + 1, len(points)), -len(points) % GROUP
    others = torch.nn.functional.pad(points, (0, 0, 0, spare)).T
    offset = torch.nn.functional.pad(points.square().sum(-1), (0, spare), value=torch.inf)
    found = []
    at_once = SPACING_ROWS if points.device.type == "cpu" else max(1, SPACING_VALUES // len(points))
    for rows in points.split(at_once):
        dist_sq = torch.addmm(offset + rows.square().sum(-1, keepdim=True), rows, others, alpha=-2)
        groups = dist_sq.unflatten(1, (GROUP, -1))
        chosen = groups.amin(dim=1).topk(min(k, groups.shape[2]), dim=1, largest=False).indices
        picked = groups.gather(2, chosen[:, None].expand(-1, GROUP, -1)).flatten(1)
        found.append(picked.topk(k, dim=1, largest=False).values[:, -1])
    return torch.cat(found).clamp_min(0).sqrt()


def project(
    field: PDDF,
    modulations: Sequence[Float[Tensor, "1 _"]] | None,
    points: Float[Tensor, "n 3"],
    config: CloudConfig,
    generator: torch.Generator,
    box: Box = CUBE,
    aimed: float = 0.0,
) -> ProjectedPoints:
    """One cycle: q = p + d(p, v̂*) v̂*, rechecked. Costs n (n_v + 1 + 2 `recheck`) queries, values only.

    Args:
      aimed: share of the directions that go to random points of the box; the others are uniform.
    """
    parts: list[tuple[Tensor, Tensor, Tensor]] = []
    for chunk in points.split(max(1, CHUNK_RAYS[points.device.type] // config.num_directions)):
        shape = (len(chunk), config.num_directions, 3)
        towards = torch.randn(shape, generator=generator, dtype=points.dtype, device=points.device)
        if aimed:
            to_box = towards[:, : round(aimed * config.num_directions)]
            to_box.copy_(_in_box_uniformly(to_box, box) - chunk[:, None])
        candidates = torch.nn.functional.normalize(towards, dim=-1)
        raw = field(chunk[:, None].expand(shape).reshape(-1, 3), candidates.reshape(-1, 3), modulations)
        raw = raw.reshape(*shape[:2], -1)
        direction = udf.closest_directions(
            candidates, visibility(raw), field.depth(raw), config.temperature, config.inverse_depth
        )
        raw = field(chunk, direction, modulations)
        hit = chunk + field.depth(raw)[:, None] * direction
        seen = visibility(raw)
        parts.append((*recheck(field, modulations, hit, direction, seen, config.recheck, box), seen))
    points, confidence, seen = (torch.cat(tensors) for tensors in zip(*parts, strict=True))
    return ProjectedPoints(points, seen, confidence)


def _corners(box: Box, like: Tensor) -> tuple[Float[Tensor, "3"], Float[Tensor, "3"]]:
    """Lower and upper corner, in the type and the place of a tensor."""
    lower, upper = arrays.send(torch.tensor([list(corner) for corner in box], dtype=like.dtype), like.device)
    return lower, upper


def _in_box_uniformly(normal: Float[Tensor, "*n 3"], box: Box) -> Float[Tensor, "*n 3"]:
    """Points spread evenly in the box, from numbers of N(0, 1): their distribution function is uniform in [0, 1]."""
    lower, upper = _corners(box, normal)
    return lower + (upper - lower) * torch.special.ndtr(normal)


def recheck(
    field: PDDF,
    modulations: Sequence[Float[Tensor, "1 _"]] | None,
    points: Float[Tensor, "n 3"],
    directions: Float[Tensor, "n 3"],
    seen: Float[Tensor, "n"],
    offsets: Sequence[float],
    box: Box = CUBE,
) -> tuple[Float[Tensor, "n 3"], Float[Tensor, "n"]]:
    """Points moved along their rays to the median of what the field says from before and from behind them.

    Before, at q - s v, it says that the surface is d(q - s v, v) - s ahead of q; behind, at q + s v, s - d(q + s v, -v)
    (property I: a surface has no inside). Starts outside the box are not asked and agree with q. No offsets, no query.

    Args:
      seen: ξ of the rays that led to the points.
    Returns:
      The points, and the mean of `seen` and of ξ of all answers.
    """
    if not offsets:
        return points, seen
    both = [side * offset for offset in offsets for side in (-1.0, 1.0)]
    step = arrays.send(torch.tensor(both, dtype=points.dtype), points.device)
    starts = points + step[:, None, None] * directions
    looking = -step.sign()[:, None, None] * directions
    raw = field(starts.reshape(-1, 3), looking.reshape(-1, 3), modulations)
    depth, answers = field.depth(raw).reshape(len(step), -1), visibility(raw).reshape(len(step), -1)
    lower, upper = _corners(box, points)
    inside = ((starts >= lower) & (starts <= upper)).all(dim=-1)
    ahead = torch.where(inside, step[:, None] - step.sign()[:, None] * depth, 0.0)
    moved = torch.cat((torch.zeros_like(ahead[:1]), ahead)).median(dim=0).values
    confidence = torch.cat((seen[None], torch.where(inside, answers, seen))).mean(dim=0)
    return points + moved[:, None] * directions, confidence


@torch.no_grad()
def sample(
    field: PDDF,
    modulations: Sequence[Float[Tensor, "1 _"]] | None,
    count: int,
    config: CloudConfig,
    generator: torch.Generator,
    box: Box = CUBE,
) -> list[ProjectedPoints]:
    """Project the (1 + ε_p) n_p points p ~ U[B] that a cloud of n_p = `count` asks for.

    Args:
      box: lower and upper corner of B, where the field was trained and which holds the shape.
    Returns:
      One result per cycle, so that N_H = 1 comes for free with N_H = 3. Points farther than `BEYOND` outside B have no
      visibility and no confidence, so they are chosen last.
    """
    weight = field.network.head.weight
    lower, upper = _corners(box, weight)
    shape = (num_drawn(count), 3)
    unit = torch.rand(shape, generator=generator, dtype=weight.dtype, device=weight.device)
    points = lower + (upper - lower) * unit
    cycles = [_in_box(project(field, modulations, points, config, generator, box, config.aimed), lower, upper)]
    for _ in range(config.cycles - 1):
        points = cycles[-1].points
        if config.jitter:
            noise = torch.randn(shape, generator=generator, dtype=weight.dtype, device=weight.device)
            points = points + config.jitter * noise
        points = torch.minimum(torch.maximum(points, lower), upper)  # what overshoots restarts on the box
        cycles.append(_in_box(project(field, modulations, points, config, generator, box), lower, upper))
    return cycles


def _in_box(found: ProjectedPoints, lower: Float[Tensor, "3"], upper: Float[Tensor, "3"]) -> ProjectedPoints:
    """The same points, without visibility and confidence where they lie `BEYOND` the box: such a ray left it unseen."""
    inside = ((found.points >= lower - BEYOND) & (found.points <= upper + BEYOND)).all(dim=-1)
    return ProjectedPoints(found.points, found.visibility * inside, found.confidence * inside)


MOST_POINTS = 2**14  # that one program keeps beside its processor; more are numpy's


def farthest_point_order(
    points: Float[Tensor, "n 3"], count: int, weights: Float[Tensor, "n"] | None = None
) -> Int[Tensor, "count"]:
    """Indices in the order in which each point is the farthest from all before it, its distance times its weight.

    The first is the heaviest (point 0 without weights). Source: Gonzalez 1985; weights derived here. Costs n distances
    per index. With repeated points, indices repeat once all places are taken.

    Args:
      weights: > 0. Around points of weight w the spacing is proportional to 1 / w.
    """
    if points.is_cuda and fits(points) and importlib.util.find_spec("triton"):
        from ddf.fields import farthest_kernel

        return farthest_kernel.order(points, count, torch.ones_like(points[:, 0]) if weights is None else weights)
    x, y, z = np.ascontiguousarray(points.T.cpu().numpy())
    scale = np.ones(len(x), dtype=x.dtype) if weights is None else np.square(weights.cpu().numpy())
    distance_sq = np.full(len(x), np.inf, dtype=x.dtype)
    order = np.zeros(count, dtype=np.int64)
    order[0] = scale.argmax()
    for i in range(count - 1):
        latest = order[i]
        gap_sq = np.square(x - x[latest]) + np.square(y - y[latest]) + np.square(z - z[latest])
        np.minimum(distance_sq, gap_sq, out=distance_sq)
        order[i + 1] = (distance_sq if weights is None else distance_sq * scale).argmax()
    return torch.from_numpy(order).to(points.device)


def fits(points: Float[Tensor, "n 3"]) -> bool:
    """Whether the kernel takes these points."""
    return points.dtype == torch.float32 and len(points) <= MOST_POINTS
