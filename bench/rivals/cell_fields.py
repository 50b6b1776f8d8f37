"""A field of many small networks, one for each of the cells that lines are cut into (`cells`): fewer operations a ray.

A ray is asked from the networks of the cells it lies in, all of one cell together: rays are sorted by cell into blocks
of `BLOCK`, and a layer is one batched product of all blocks. What several networks say of a ray is added up by the
weights of their cells: visibility as it is, before any activation; depth over those that see something. Where all of
them do, depth and its derivative are continuous. A ray that begins inside the box is taken for its whole line.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn import functional

from bench.rivals import cells, ray_fields, rival_training
from ddf.fields import derivatives, losses, pddf
from ddf.fit import fit_settings
from ddf.training import training_loop

BLOCK, BLOCKS = 64, 64  # rays of a block, blocks at a time: what stays in a core's cache
SURE = 0.01  # a network begins with the share of its rays that see something, but for so much
NOTHING = (0.0, 0.0, 0.0, -4.0)  # raw outputs of no network


class CellNetworks(nn.Module):
    """Sine networks of one layout, drawn as `siren` draws them; raw outputs as in `pddf`, the depths being z."""

    def __init__(self, count: int, hidden: Sequence[int], omega: float) -> None:
        super().__init__()
        shapes = list(itertools.pairwise((cells.SIDES, *hidden, pddf.NUM_OUTPUTS)))
        scales = (omega, *[1.0] * len(hidden))
        self.matrices = nn.ParameterList(
            scale * math.sqrt(6 / a) * (2 * torch.rand(count, a, b) - 1)
            for scale, (a, b) in zip(scales, shapes, strict=True)
        )
        self.shifts = nn.ParameterList(
            scale / math.sqrt(a) * (2 * torch.rand(count, 1, b) - 1)
            for scale, (a, b) in zip(scales, shapes, strict=True)
        )

    def forward(self, local: Float[Tensor, "k n 4"], who: Int[Tensor, "k"] | None = None) -> Float[Tensor, "k n 4"]:
        """Of so many rays of each network, or of those of `who`."""
        hidden, in_place = local, not torch.is_grad_enabled()
        last = len(self.matrices) - 1
        for layer, (matrix, shift) in enumerate(zip(self.matrices, self.shifts, strict=True)):
            if who is not None:
                matrix, shift = matrix.index_select(0, who), shift.index_select(0, who)
            hidden = torch.bmm(hidden, matrix).add_(shift)
            if layer < last:
                hidden = hidden.sin_() if in_place else hidden.sin()
        return hidden


@dataclass(frozen=True)
class CellField:
    """networks: one of each cell that a ray of the training lay in. which: that of each cell, or -1."""

    networks: CellNetworks
    which: Int[Tensor, "cells"]
    layout: cells.CellLayout
    upper: tuple[float, float, float]

    def _asked(self, p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"]) -> Float[Tensor, "n 2"]:
        """Depth and raw visibility."""
        found = cells.pairs(p, v, self.layout, self.upper)
        raw = outputs(self.networks, self.which.index_select(0, found.cells), found.local)
        z = torch.where(pddf.first_is_heavier(raw), raw[:, 0], raw[:, 1])
        logit = raw[:, pddf.VISIBILITY_ROW]
        seeing = found.weights * (logit >= 0)
        parts = seeing * (found.before + z * found.rate), seeing, found.weights * logit
        depth, sure, visibility = (part.new_zeros(len(p)).index_add(0, found.rows, part) for part in parts)
        return torch.stack((depth / sure, visibility), dim=-1)

    def depth(self, p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"]) -> Float[Tensor, "n"]:
        """Along v from p; `inf` where nothing is seen."""
        depth, logit = self._asked(p, v).unbind(-1)
        return torch.where(logit >= 0, depth, torch.inf)

    def normals(self, p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        """Unit, facing back, by autograd through all of it; of rays that see something."""
        with torch.inference_mode(False), torch.enable_grad():
            p, v = p.clone().requires_grad_(), v.clone()
            (gradient,) = torch.autograd.grad(self._asked(p, v)[:, 0].sum(), p)
        return derivatives.normals(gradient, v)


def outputs(networks: CellNetworks, who: Int[Tensor, "m"], local: Float[Tensor, "4 m"]) -> Float[Tensor, "m 4"]:
    """Raw outputs, each ray by its network; -1 is no network, which sees nothing."""
    order = torch.from_numpy(np.argsort(who.to(torch.int16).numpy(), kind="stable"))
    names, counts = torch.unique_consecutive(who.index_select(0, order), return_counts=True)
    blocks = (counts + BLOCK - 1) // BLOCK
    shift = BLOCK * (blocks.cumsum(0) - blocks) - (counts.cumsum(0) - counts)
    place = torch.zeros_like(order)
    place[order] = torch.arange(len(order)) + shift.repeat_interleave(counts)
    whose = names.repeat_interleave(blocks)
    laid = local.new_zeros(BLOCK * len(whose), cells.SIDES).index_copy(0, place, local.T)
    parts = zip(laid.view(-1, BLOCK, cells.SIDES).split(BLOCKS), whose.clamp(min=0).split(BLOCKS), strict=True)
    raw = torch.cat([networks(rays, asked) for rays, asked in parts])
    raw = raw.view(-1, pddf.NUM_OUTPUTS).index_select(0, place)
    return raw if int(names[0]) >= 0 else torch.where((who < 0)[:, None], raw.new_tensor(NOTHING), raw)


@dataclass(frozen=True)
class Lesson:
    """Rays and networks in pairs, those of one network together: `count` of them from `first` on."""

    local: Float[Tensor, "m 4"]
    z: Float[Tensor, "m"]
    visible: Float[Tensor, "m"]
    first: Int[Tensor, "k"]
    count: Int[Tensor, "k"]

    def drawn(self, random: np.random.Generator, each: int) -> Int[Tensor, "rays"]:
        """Rows of so many pairs of every network, one network after the other."""
        share = torch.from_numpy(random.random((len(self.count), each), dtype=np.float32))
        return (self.first[:, None] + (share * self.count[:, None]).long()).flatten()


def lesson(
    seen: ray_fields.SeenRays, layout: cells.CellLayout, upper: tuple[float, float, float]
) -> tuple[Lesson, Int[Tensor, "cells"]]:
    """Of all rays, and the network of each cell, -1 where no ray lies."""
    found = cells.pairs(seen.positions, seen.directions, layout, upper)
    order = torch.argsort(found.cells, stable=True)
    names, count = torch.unique_consecutive(found.cells[order], return_counts=True)
    which = torch.full((6 * layout.cells,), -1).index_copy(0, names, torch.arange(len(names)))
    rows = found.rows[order]
    visible = seen.truth.visible[rows]
    z = (seen.truth.depth.to(found.before)[rows] - found.before[order]) / found.rate[order]
    first = count.cumsum(0) - count
    taught = Lesson(found.local.T[order], torch.where(visible, z, 0.0), visible.to(z), first, count)
    return taught, which


def start(networks: CellNetworks, taught: Lesson) -> None:
    """Both depths of a network begin as the mean z of its rays, its visibility as the share that see something."""
    owner = torch.arange(len(taught.count)).repeat_interleave(taught.count)
    seeing, depth = (torch.zeros(len(taught.count)).index_add(0, owner, part) for part in (taught.visible, taught.z))
    share = (seeing / taught.count).clamp(SURE, 1 - SURE)
    with torch.no_grad():
        bias = networks.shifts[-1][:, 0]
        bias[:, : pddf.NUM_COMPONENTS] = (depth / seeing.clamp(min=1))[:, None]
        bias[:, pddf.WEIGHT_ROW] = 0
        bias[:, pddf.VISIBILITY_ROW] = torch.logit(share)


def fit(
    layout: cells.CellLayout,
    hidden: Sequence[int],
    omega: float,
    seen: ray_fields.SeenRays,
    upper: tuple[float, float, float],
    config: fit_settings.FitConfig,
    rays_each: int,
    steps: int,
) -> CellField:
    """Trained on values, as `ray_fields.fit`, for so many steps on so many rays of every network.

    Args:
      omega: of the first layers.
      upper: corner of the box, whose centre is the origin.
      config: weights of the loss and loop.
    """
    training_loop.prepare(config.loop)
    taught, which = lesson(seen, layout, upper)
    networks = CellNetworks(len(taught.count), hidden, omega)
    start(networks, taught)

    def loss(step: int) -> tuple[Tensor, dict[str, Tensor]]:
        rows = taught.drawn(np.random.default_rng((config.loop.seed, step)), rays_each)
        local, z, visible = (part.index_select(0, rows) for part in (taught.local, taught.z, taught.visible))
        raw = networks(local.view(-1, rays_each, cells.SIDES)).flatten(0, 1)
        first, second = (losses.depth_error(raw[:, i], z, config.weights.depth_huber) for i in range(2))
        depth = (visible * torch.lerp(second, first, torch.sigmoid(raw[:, pddf.WEIGHT_ROW]))).mean()
        silhouette = functional.binary_cross_entropy_with_logits(raw[:, pddf.VISIBILITY_ROW], visible)
        return config.weights.depth * depth + config.weights.visibility * silhouette, {"depth": depth.detach()}

    rival_training.trained(networks, loss, steps, config.loop, "field of cells").requires_grad_(False)
    return CellField(networks, which, layout, upper)
