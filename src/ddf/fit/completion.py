"""The whole shape from what a depth camera or a lidar saw of it: maximum a posteriori descent through a field.

A ray (p, v) enters the field's cube after a way e. With d_i, w_i and ξ of the field there, a range r that ends in the
cube has the likelihood (1 - ε) ξ Σ_i w_i L(r - e; d_i, b) + ε / 2c, with L Laplace's density of scale b and c the way
through the cube; a ray that leaves the cube has (1 - ε)(1 - ξ) + ε / 2, so free space is evidence. The descent is on
the mean of the negative logarithms plus λ |u|² / 2, in the shape's coordinates u (`latent_prior`) and, where it is not
known, in the pose, from the best of many draws (derived here).

Where the scale is not known, the hits are held to the length of the cube that they take up in scans of one side.

What is left open is told by Laplace's approximation: the curvature 1 + mean(g gᵀ)/λ, of the rays' gradients g in u.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn import functional

from ddf.core import checks
from ddf.fields import pddf, rendering, shape_field
from ddf.fields.grid import patch_field, soft_rays
from ddf.fit import latent_prior
from ddf.geometry import rays, scans, transforms

FEWEST_HITS = 10
_MOST = 4096  # rays of a scan that are kept, of each sort
_CROP = 1.5  # half sides of the box around the cube, beyond which a hit is of something else
_LEAST_WAY = 1e-3
_STRAY = 0.02  # share of hits on each side that a box of them leaves out
_TAKEN, _TAKEN_OFF = math.log(0.87), 0.06  # of the cube's length, by that box: logarithm and its deviation, 66 scans
_FOR_BOX = 800  # hits
_TIE = 0.03  # weight of that in the loss
_AT_ONCE = 32  # draws
_TOGETHER = 64  # objects of a descent, for memory
_KIND = (0.62, 7.4, -0.029, 2.46)  # of `_likeness`: hits, free rays, |u|², constant
_APART = math.radians(25.0)  # between starts that are turned anyhow


@dataclass(frozen=True)
class Doubt:
    """How far the given pose may be off, deviations: turn in degrees, shift and growth in half longest sides.

    around: the turn about the field's vertical axis may be any. anyhow: half of the draws are turned at random, and the
    starts lie apart; of poses in which a shape looks the same, the least turned is likeliest.
    """

    turn_deg: float = 15.0
    shift: float = 0.1
    growth: float = 0.1
    around: bool = False
    anyhow: bool = False


UPRIGHT = Doubt(5.0, 0.15, 0.15, around=True)
LOOKED_AT = Doubt(20.0, 0.15, 0.15, around=True)  # upright before a camera that looks down by `_DOWN` or so
_DOWN = math.radians(20.0)


@dataclass(frozen=True)
class CompletionConfig:
    """How a scan is completed.

    rays: of the scan in a step. draws: shapes, and poses, that are tried; starts: the best of them, from which the
    descent begins; kept: those that go on after the first third. steps, rate: of Adam; pose_rate: of the pose. blur: b
    of a noiseless sensor, field units, for the field itself is not exact. prior: λ. outliers: ε. axes: of u.
    samples: of Laplace's approximation.
    """

    rays: int = 400
    draws: int = 256
    starts: int = 4
    kept: int = 2
    axes: int = 64
    steps: int = 200
    rate: float = 0.1
    pose_rate: float = 0.02
    blur: float = 0.03
    prior: float = 0.003
    outliers: float = 0.1
    samples: int = 32


_KNOWN = CompletionConfig(rays=100, draws=1024, starts=16)  # of a shape that is known


@dataclass(frozen=True)
class Completed:
    """What was found.

    scan_from_field: the pose. modulations: of the field; `samples`: of as many shapes that the scan leaves open.
    residuals: range seen minus range of the field, unit of the scan, of every ray of the scan that meets the cube
    and that both see; NaN elsewhere. explained: share of hits in the cube within three `width` of the field's.
    scatter: mean distance of these hits from the field's along the ray, field units, whether it sees anything or not.
    likeness: the probability that the object is of the model's kind (`_likeness`). width: b, field units, with the
    sensor's noise.
    """

    scan_from_field: transforms.Similarity
    modulations: list[Float[Tensor, "1 _"]]
    samples: list[Float[Tensor, "s 1 _"]]
    residuals: Float[np.ndarray, "n"]
    explained: float
    scatter: float
    likeness: float
    width: float


@dataclass(frozen=True)
class _Rays:
    """Of a scan, in the frame of the first pose; range inf: met nothing."""

    positions: Float[Tensor, "*n 3"]
    directions: Float[Tensor, "*n 3"]
    ranges: Float[Tensor, "*n"]

    def some(self, index: Any) -> "_Rays":
        return _Rays(self.positions[index], self.directions[index], self.ranges[index])

    def hits(self) -> "_Rays":
        """Some of those that met something."""
        return self.some(self.ranges.isfinite().nonzero()[:_FOR_BOX, 0])

    def points(self) -> Float[Tensor, "*n 3"]:
        """Where they end."""
        return rays.surface_points(self.positions, self.directions, self.ranges)


@dataclass
class _State:
    """Of objects and starts: u, and the pose relative to the first one, x ↦ exp(growth) exp([turn]_×) x + shift."""

    u: Float[Tensor, "*_ axes"]
    turn: Float[Tensor, "*_ 3"]
    shift: Float[Tensor, "*_ 3"]
    growth: Float[Tensor, "*_"]

    def all(self) -> tuple[Tensor, ...]:
        return self.u, self.turn, self.shift, self.growth

    def at(self, index: Any) -> "_State":
        return _State(*(each.detach()[index].clone() for each in self.all()))

    def best(self, loss: Float[Tensor, "objects k"], count: int) -> "_State":
        """So many starts of each object, those of the least loss."""
        index = loss.topk(min(count, loss.shape[1]), largest=False).indices
        return self.at((torch.arange(len(loss))[:, None], index))


def complete(
    model: pddf.ConditionalPDDF,
    prior: latent_prior.LatentPrior,
    scan: scans.Scan,
    scan_from_field: transforms.Similarity,
    doubt: Doubt | None = None,
    noise: float = 0.0,
    config: CompletionConfig | None = None,
    latent: Float[Tensor, "z"] | None = None,
    seed: int = 0,
) -> Completed:
    """The likeliest shape of a scan, and its pose where there is doubt of it.

    Args:
      scan_from_field: where the cube [-1, 1]³ lies that just holds the shape; its unit is half the longest side.
      doubt: None where that is known. noise: deviation of a range, unit of the scan.
      latent: of an image of the shape, one more start.
    Raises:
      InputError: too few rays end in the cube.
    """
    config, generator = config or CompletionConfig(), torch.Generator().manual_seed(seed)
    width = math.hypot(config.blur, noise / scan_from_field.scale)
    seen = _evidence(scan, scan_from_field, generator, prior.mean)
    hits = seen.hits().points() if doubt is not None and doubt.growth else None
    problem = _Problem(model, prior, width, config, hits=hits)
    best, sample = _likeliest(problem, [seen], doubt, latent, generator)
    pose = scan_from_field.compose(_similarity(best.at(0)))
    spread = _open(problem, sample.some((0, 0)), best, generator)
    modulations = [each.detach()[0] for each in model.modulations(prior.latents(best.u))]
    samples = [each.detach() for each in model.modulations(prior.latents(spread))]
    told = _residuals(problem, scan, pose, modulations)
    return Completed(pose, modulations, samples, *told, _likeness(problem, best, sample), width)


def find(
    shape: shape_field.ShapeField | patch_field.PatchField,
    scan: scans.Scan,
    scan_from_field: Sequence[transforms.Similarity],
    doubt: Doubt,
    noise: float = 0.0,
    seed: int = 0,
) -> list[transforms.Similarity]:
    """The likeliest pose of each of several objects of a scan, all of one shape that is known, in one descent.

    Arguments and errors are as of `complete`; the noise is told by the mean of the scales.
    """
    config, generator, like = _KNOWN, torch.Generator().manual_seed(seed), torch.zeros(1)
    width = math.hypot(config.blur, noise / float(np.mean([start.scale for start in scan_from_field])))
    patches = isinstance(shape, patch_field.PatchField)
    field, margin = (soft_rays.SoftPatches(shape, width), width) if patches else (shape.field, 0.0)
    box = torch.from_numpy(shape.lower - margin).to(like), torch.from_numpy(shape.upper + margin).to(like)
    alone = latent_prior.LatentPrior(like, like.new_zeros(1, 0))
    problem = _Problem(_Known(field), alone, width, config, box, tied=1 / math.radians(doubt.turn_deg) ** 2)
    found = []
    for first in range(0, len(scan_from_field), _TOGETHER):
        starts = scan_from_field[first : first + _TOGETHER]
        seen = [_evidence(scan, start, generator, like) for start in starts]
        best = _likeliest(problem, seen, doubt, None, generator)[0]
        found += [start.compose(_similarity(best.at(index))) for index, start in enumerate(starts)]
    return found


def guess(scan: scans.Scan, up: Float[np.ndarray, "3"] | None = None) -> transforms.Similarity:
    """A pose of an object that stands upright and of which alone all hits are: the box of most of them. InputError
    where there are too few. up: unit vector of the scan's frame; None is that of the mean camera that took it.
    """
    if scan.hit.sum() < FEWEST_HITS:
        raise checks.InputError(_why_none(scan, transforms.Similarity()))
    lower, upper = np.quantile(scan.points, [_STRAY, 1 - _STRAY], axis=0)
    up = np.array([0.0, -math.cos(_DOWN), -math.sin(_DOWN)]) if up is None else up
    ahead = np.eye(3)[int(np.argmin(np.abs(up)))]
    ahead = ahead - (ahead @ up) * up
    ahead /= np.linalg.norm(ahead)
    rotation = np.stack((ahead, up, np.cross(ahead, up)), axis=1)
    return transforms.Similarity(float((upper - lower).max()) / 2, rotation, (lower + upper) / 2)


def _evidence(
    scan: scans.Scan, scan_from_field: transforms.Similarity, generator: torch.Generator, like: Tensor
) -> _Rays:
    """Rays that say something of the cube, in its frame; those that pass through it unhindered have range inf."""
    inverse = scan_from_field.inverse()
    positions, directions = inverse.apply(scan.positions), inverse.apply_directions(scan.directions)
    ranges = inverse.scale_depth(scan.ranges)
    corner = np.full(3, _CROP * rendering.CUBE_HALF)
    near, far = rays.box_span(positions, directions, -corner, corner)
    inside = (near <= far) & (ranges >= near) & (ranges <= far)
    inner_near, inner_far = rays.box_span(positions, directions, -corner / _CROP, corner / _CROP)
    free = (inner_near <= inner_far) & (ranges > far)
    if inside.sum() < FEWEST_HITS:
        raise checks.InputError(_why_none(scan, inverse))
    chosen = []
    for sort in (inside, free):
        index = np.flatnonzero(sort)
        order = torch.randperm(len(index), generator=generator)[:_MOST].numpy()
        chosen.append(index[order])
    index = np.concatenate(chosen)
    kept = np.where(inside, ranges, np.inf)[index]
    return _Rays(*(torch.from_numpy(each).to(like) for each in (positions[index], directions[index], kept)))


def _why_none(scan: scans.Scan, field_from_scan: transforms.Similarity) -> str:
    """Why a scan says nothing, with what to do."""
    count = int(scan.hit.sum())
    if count < FEWEST_HITS:
        return (
            f"the scan has {count} rays that met something of {len(scan.ranges):,}; at least {FEWEST_HITS} are needed"
        )
    away = float(np.median(np.linalg.norm(field_from_scan.apply(scan.points), axis=-1)))
    hint = "are ranges in millimetres, and the pose in metres?" if away > 100 else "give the pose of the object's box"
    return f"under {FEWEST_HITS} of {count:,} hits lie in the box of the pose, most {away:.3g} half sides off; {hint}"


def _pick(many: Sequence[_Rays], count: int, generator: torch.Generator) -> _Rays:
    """So many rays of each object, (objects, 1, n); where it has fewer, they are there over and over."""
    picked = [each.some(_mixed(each, count, generator)) for each in many]
    most = max(len(each.ranges) for each in picked)
    filled = [each.some(torch.arange(most) % len(each.ranges)) for each in picked]
    lists = ([getattr(each, name) for each in filled] for name in ("positions", "directions", "ranges"))
    return _Rays(*(torch.stack(each)[:, None] for each in lists))


def _mixed(seen: _Rays, count: int, generator: torch.Generator) -> Tensor:
    """Indices of so many rays, half of them hits where there are enough."""
    hit = seen.ranges.isfinite()
    hits, others = (
        index[torch.randperm(len(index), generator=generator)]
        for index in (hit.nonzero()[:, 0], (~hit).nonzero()[:, 0])
    )
    number = min(len(hits), max(count // 2, count - len(others)))
    return torch.cat((hits[:number], others[: count - number]))


@dataclass(frozen=True)
class _Known:
    """A single shape in place of a model. field: a network, or `soft_rays.SoftPatches`."""

    field: Any

    def modulations(self, _: Tensor) -> None:
        """None that vary."""
        return


@dataclass(frozen=True)
class _Problem:
    """What the descent is on.

    box: corners of that of the field, None for the cube. hits: that the scale is tied to. tied: of the turn to the
    first pose, one over its variance.
    """

    model: pddf.ConditionalPDDF | _Known
    prior: latent_prior.LatentPrior
    width: float
    config: CompletionConfig
    box: tuple[Tensor, Tensor] | None = None
    hits: Float[Tensor, "m 3"] | None = None
    tied: float = 0.0

    def loss(self, state: _State, seen: _Rays) -> Float[Tensor, "*k"]:
        """Of each start."""
        unlikely = state.u.square().sum(-1) + self.tied * state.turn.square().sum(-1)
        loss = -self.log_likelihoods(state, seen).mean(-1) + self.config.prior * unlikely / 2
        return loss if self.hits is None else loss + _TIE * self.untaken(state, self.hits).square() / 2

    def untaken(self, state: _State, hits: Float[Tensor, "m 3"]) -> Float[Tensor, "*k"]:
        """How far the longest side of the box of most hits is from what it mostly is of the cube's, deviations."""
        turned = hits @ rotations(state.turn)
        low, high = torch.quantile(turned, torch.tensor([_STRAY, 1 - _STRAY]).to(turned), dim=-2)
        taken = ((high - low) / 2 / rendering.CUBE_HALF).amax(-1).log() - state.growth
        return (taken - _TAKEN) / _TAKEN_OFF

    def log_likelihoods(self, state: _State, seen: _Rays) -> Float[Tensor, "*k n"]:
        """Of each start and ray; lengths are those of the first pose, or growth would pay by making errors small."""
        modulations = self.model.modulations(self.prior.latents(state.u))
        rotation = rotations(state.turn)
        shrink = torch.exp(-state.growth)[..., None]
        positions = ((seen.positions - state.shift[..., None, :]) @ rotation) * shrink[..., None]
        hit = seen.ranges.isfinite()  # the gradient of what is infinite is no number
        directions, ranges = seen.directions @ rotation, torch.where(hit, seen.ranges, 0.0) * shrink
        box = self.box or rendering.cube(positions)
        entry, way, meets = rays.enter_box(positions, directions, *box)
        near, far = rays.box_span(positions, directions, *box)
        raw = self.model.field(entry, directions, modulations)
        depths, ranges, through = self.model.field.depths(raw) / shrink[..., None], (ranges - way) / shrink, far - near
        given = (hit, through / shrink, meets, self.width, self.config.outliers)
        return ray_log_likelihood(raw, depths, ranges, *given)


def ray_log_likelihood(
    raw: Float[Tensor, "*#n out"],
    depths: Float[Tensor, "*#n k"],
    ranges: Float[Tensor, "*#n"],
    hit: Bool[Tensor, "*#n"],
    through: Float[Tensor, "*#n"],
    meets: Bool[Tensor, "*#n"],
    width: float,
    outliers: float,
) -> Float[Tensor, "*#n"]:
    """Natural logarithm of what the module says; a hit outside the cube is an outlier, a ray past it says nothing.
    raw, depths: of the field at the entry. ranges: from there, of rays that `hit` something. through: c.
    """
    outlying, kept = math.log(outliers / 2), math.log1p(-outliers)
    visibility = raw[..., pddf.VISIBILITY_ROW]
    off = (depths - ranges[..., None]).abs() / width
    mixed = torch.logsumexp(torch.log_softmax(pddf.scores(raw), -1) - off, -1) - math.log(2 * width)
    stray = outlying - through.clamp_min(_LEAST_WAY).log()
    met = torch.logaddexp(functional.logsigmoid(visibility) + mixed + kept, stray)
    missed = torch.logaddexp(functional.logsigmoid(-visibility) + kept, torch.full_like(visibility, outlying))
    inside = meets & hit & (ranges >= 0) & (ranges <= through)
    outside = torch.where(hit, outlying, 0.0)
    return torch.where(inside, met, torch.where(meets & ~hit, missed, outside))


def rotations(turn: Float[Tensor, "*k 3"]) -> Float[Tensor, "*k 3 3"]:
    """exp([ω]_×) of each."""
    axes = torch.eye(3).to(turn).expand(*turn.shape, 3)
    return torch.linalg.matrix_exp(torch.linalg.cross(turn[..., None, :].expand_as(axes), axes).mT)


def _similarity(state: _State) -> transforms.Similarity:
    """The pose of a single object, relative to the first one."""
    u, _, right = np.linalg.svd(rotations(state.turn.double()).numpy())
    return transforms.Similarity(math.exp(float(state.growth)), u @ right, state.shift.double().numpy())


def _likeliest(
    problem: _Problem, many: Sequence[_Rays], doubt: Doubt | None, latent: Tensor | None, generator: torch.Generator
) -> tuple[_State, _Rays]:
    """The best state of each object, and the rays that these were told by."""
    state = _descend(problem, many, _starts(problem, many, doubt, latent, generator), doubt, generator)
    sample = _pick(many, 4 * problem.config.rays, generator)
    with torch.no_grad():
        loss = problem.loss(state, sample)
    return state.best(loss, 1).at((slice(None), 0)), sample


def _starts(
    problem: _Problem, many: Sequence[_Rays], doubt: Doubt | None, latent: Tensor | None, generator: torch.Generator
) -> _State:
    """The likeliest of random shapes, at random poses where there is doubt; the prior's mean is one of them."""
    config, shape = problem.config, (len(many), problem.config.draws)

    def normal(*last: int) -> Tensor:
        return torch.randn(*shape, *last, generator=generator)

    u = normal(problem.prior.basis.shape[1])
    u[:, 0] = 0
    if latent is not None:
        u[:, 1::2] = problem.prior.coordinates(latent)
    turn, shift, growth = torch.zeros(*shape, 3), torch.zeros(*shape, 3), torch.zeros(shape)
    if doubt is not None:
        turn, shift = math.radians(doubt.turn_deg) * normal(3), doubt.shift * normal(3)
        growth = doubt.growth * normal()
        if doubt.around:
            turn[..., 1] = 2 * math.pi * (torch.arange(config.draws) / config.draws)
        else:
            if doubt.anyhow:
                turn[:, 1::2] = _any_turns(normal(4)[:, 1::2])
            turn[:, 0], shift[:, 0], growth[:, 0] = 0, 0, 0
    state = _State(u, turn, shift, growth)
    with torch.no_grad():
        few = _pick(many, config.rays // 2, generator)
        parts = torch.arange(config.draws).split(max(1, _AT_ONCE // len(many)))
        loss = torch.cat([problem.loss(state.at((slice(None), part)), few) for part in parts], dim=1)
    if doubt is not None and doubt.anyhow:
        return state.at((torch.arange(len(many))[:, None], _apart(loss, rotations(turn), config.starts)))
    return state.best(loss, config.starts)


def _apart(loss: Float[Tensor, "objects k"], turned: Float[Tensor, "objects k 3 3"], count: int) -> Tensor:
    """Indices of so many of the least loss of each object, of which none is turned by `_APART` or less from another."""
    rows, left, chosen = torch.arange(len(loss)), loss.clone(), []
    for _ in range(count):
        chosen.append(left.argmin(1))
        trace = (turned * turned[rows, chosen[-1]][:, None]).sum((-2, -1))
        left[trace >= 1 + 2 * math.cos(_APART)] = math.inf
    return torch.stack(chosen, 1)


def _any_turns(quaternions: Float[Tensor, "*k 4"]) -> Float[Tensor, "*k 3"]:
    """ω of the rotations of quaternions of any length; of normal ones, that of any rotation."""
    cosine, sine = quaternions[..., :1].abs(), quaternions[..., 1:].norm(dim=-1, keepdim=True)
    axes = quaternions[..., 1:] * quaternions[..., :1].sign() / sine
    return 2 * torch.atan2(sine, cosine) * axes


def _descend(
    problem: _Problem, many: Sequence[_Rays], state: _State, doubt: Doubt | None, generator: torch.Generator
) -> _State:
    """Adam, its rate falling to zero by a cosine; after a third of the steps the best starts alone go on."""
    config = problem.config
    cut = config.steps // 3
    for begin, end in ((0, cut), (cut, config.steps)):
        moved = state.all()[: 1 if doubt is None else 4 if doubt.growth else 3]
        groups = [
            {"params": [each.requires_grad_()], "share": 1.0 if each is state.u else config.pose_rate / config.rate}
            for each in moved
        ]
        optimiser = torch.optim.Adam(groups, lr=config.rate, betas=(0.9, 0.99))
        for step in range(begin, end):
            for group in optimiser.param_groups:
                group["lr"] = group["share"] * config.rate * (1 + math.cos(math.pi * step / config.steps)) / 2
            loss = problem.loss(state, _pick(many, config.rays, generator))
            for each, gradient in zip(moved, torch.autograd.grad(loss.sum(), moved), strict=True):
                each.grad = gradient
            optimiser.step()
        with torch.no_grad():
            loss = problem.loss(state, _pick(many, 2 * config.rays, generator))
        state = state.best(loss, config.kept)
    return state


@torch.no_grad()
def _likeness(problem: _Problem, best: _State, seen: _Rays) -> float:
    """The probability that a scan is of the model's kind: hits and free rays are likely, and the shape is usual.

    A logistic regression on these three, of 69 scans of validation shapes and of other objects, pose and scale unknown;
    log-likelihoods as of a noiseless sensor. `python -m bench complete` tells how many it takes for others.
    """
    likely, hit = problem.log_likelihoods(_State(*(each[:, None] for each in best.all())), seen), seen.ranges.isfinite()
    of_hits = likely[hit].mean() + math.log(problem.width / problem.config.blur)
    of_free = likely[~hit].mean() if (~hit).any() else likely.new_zeros(())
    values = torch.stack((of_hits, of_free, best.u.square().sum(), likely.new_ones(())))
    return float(torch.sigmoid(values @ values.new_tensor(_KIND)))


def _open(problem: _Problem, seen: _Rays, best: _State, generator: torch.Generator) -> Float[Tensor, "s axes"]:
    """Coordinates drawn from Laplace's approximation at the best ones, the pose kept."""
    each = best.u.expand(len(seen.ranges), -1).clone().requires_grad_()  # so that every ray has a gradient of its own
    alone = _Rays(seen.positions[:, None], seen.directions[:, None], seen.ranges[:, None])
    likely = problem.log_likelihoods(_State(each, *best.all()[1:]), alone)
    (slopes,) = torch.autograd.grad(likely.sum(), each)
    curvature = torch.eye(each.shape[1]) + slopes.T @ slopes / len(slopes) / problem.config.prior
    drawn = torch.randn(problem.config.samples, len(best.u[0]), generator=generator)
    factor = torch.linalg.cholesky(curvature)
    return best.u + torch.linalg.solve_triangular(factor.T, drawn.T, upper=True).T


@torch.no_grad()
def _residuals(
    problem: _Problem, scan: scans.Scan, pose: transforms.Similarity, modulations: list[Tensor]
) -> tuple[Float[np.ndarray, "n"], float, float]:
    """`residuals`, `explained` and `scatter` of what is completed."""
    inverse = pose.inverse()
    like = problem.prior.mean
    values = (
        inverse.apply(scan.positions),
        inverse.apply_directions(scan.directions),
        inverse.scale_depth(scan.ranges),
    )
    positions, directions, ranges = (torch.from_numpy(each).to(like) for each in values)
    cube = rendering.cube(positions)
    entry, way, meets = rays.enter_box(positions, directions, *cube)
    near, far = rays.box_span(positions, directions, *cube)
    inside = meets & (ranges >= near) & (ranges <= far)
    raw = problem.model.field(entry[inside], directions[inside], modulations)
    off = ranges[inside] - way[inside] - problem.model.field.depth(raw)
    seen = raw[:, pddf.VISIBILITY_ROW] >= 0
    residuals = np.full(len(scan.ranges), np.nan)
    residuals[inside.numpy()] = torch.where(seen, off, torch.nan).double().numpy() * pose.scale
    near_enough = seen & (off.abs() <= 3 * problem.width)
    return residuals, float(near_enough.float().mean()), float(off.abs().mean())
