"""How fields of rays describe a ray to a network: our (p, v), and what peers do from outside a shape.

Letters: p + t v a ray, |v| = 1; R the radius of a sphere about the origin that holds the box; x(p, v) the six numbers
that the network reads, f(x) >= 0 its depth, d = t_0(p, v) + f(x) the depth of the ray. d is the same function of the
ray whichever point of it p is, but for the way to that point, so that v · ∇_p d = -1 holds by construction. The normal
is n = ∇_p d/‖∇_p d‖ (Property II of [DDF22] §3.1).

Sources: Feng et al. 2022, "PRIF" and Sundt and Theoharis 2023, "MARF" (foot of the perpendicular; depth from there,
with its sign). Plücker coordinates and two points of a sphere came out alike or worse.

A field of rays has the package's sine network and loss on values, so that peers differ in what they read alone.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from bench.rivals import distances
from ddf.fields import derivatives, framed_field, losses, pddf
from ddf.fit import fit_settings, fitting, shape_samples
from ddf.geometry import rays
from ddf.training import training_loop

Positions = Float[Tensor, "n 3"]
Read = tuple[Float[Tensor, "n 6"], Float[Tensor, "n"]]  # x, and t_0: where depth is counted from, negative behind p
RayInput = Callable[[Positions, Positions], Read]  # of p and v, of rays that meet the box


def box_entry(p: Positions, v: Positions, lower: Float[Tensor, "3"], upper: Float[Tensor, "3"]) -> Read:
    """Ours: (e, v) with e = p + t_0 v, where the ray enters the box, or p itself inside it."""
    entry, way, _ = rays.enter_box(p, v, lower, upper)
    return torch.cat((entry, v), dim=-1), way


def foot(p: Positions, v: Positions, radius: float) -> Read:
    """(q, v) with q = p - (p · v) v, nearest the origin; t_0 = -p · v - R, so the network's f - R is signed."""
    along = (p * v).sum(-1, keepdim=True)
    return torch.cat((p - along * v, v), dim=-1), -along[:, 0] - radius


@dataclass(frozen=True)
class SeenRays:
    """Rays that meet the box, and what they see: depth is from the ray's start, normals face back; float32."""

    positions: Float[Tensor, "n 3"]
    directions: Float[Tensor, "n 3"]
    truth: rays.RayHits


@dataclass(frozen=True)
class RayField:
    """A network and how it reads rays."""

    network: pddf.PDDF
    reads: RayInput

    def depth(self, p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"]) -> Float[Tensor, "n"]:
        """Along v from p; `inf` where nothing is seen, or only what lies behind p."""
        x, before = self.reads(p, v)
        raw = self.network.network(x)
        depth = before + self.network.depth(raw)
        return torch.where((pddf.visibility(raw) >= framed_field.SEEN) & (depth >= 0), depth, torch.inf)

    def normals(self, p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        """∇_p d/‖∇_p d‖, facing back, whether or not anything is seen."""
        with torch.enable_grad():
            p = p.detach().requires_grad_()
            x, before = self.reads(p, v)
            depth = before + self.network.depth(self.network.network(x))
            (gradient,) = torch.autograd.grad(depth.sum(), p)
        return derivatives.normals(gradient, v)


def fit(
    reads: RayInput, lessons: Sequence[SeenRays], config: fit_settings.FitConfig, batch: int, steps: int
) -> RayField:
    """A field of rays, trained on values for so many steps on as many rays of each of the sets.

    Args:
      config: network, weights of the loss and loop.
      batch: rays of a step, all sets together.
    """
    training_loop.prepare(config.loop)
    network = pddf.PDDF(config.field)
    learnt = []  # x, f, and whether anything is visible
    for seen in lessons:
        x, before = reads(seen.positions, seen.directions)
        visible = seen.truth.visible
        learnt.append((x, torch.where(visible, seen.truth.depth.to(x) - before, 0.0), visible.to(x)))
    everything = {
        f"{index}": {"depth": depth.numpy(), "visible": visible.numpy()}
        for index, (_, depth, visible) in enumerate(learnt)
    }
    fitting.start_flat(network, shape_samples.ShapeSamples(everything, np.zeros(3), np.zeros(3)))

    def loss(step: int) -> tuple[Tensor, dict[str, Tensor]]:
        random = np.random.default_rng((config.loop.seed, step))
        rows = [torch.from_numpy(random.integers(0, len(x), batch // len(learnt))) for x, _, _ in learnt]
        chosen = [[part[index] for part in own] for own, index in zip(learnt, rows, strict=True)]
        x, truth, visible = (torch.cat(parts) for parts in zip(*chosen, strict=True))
        raw = network.network(x)
        depth = losses.depth_loss(network, raw, truth, visible, config.weights).mean()
        seen = functional.binary_cross_entropy_with_logits(raw[:, pddf.VISIBILITY_ROW], visible)
        return config.weights.depth * depth + config.weights.visibility * seen, {"depth": depth.detach()}

    return RayField(distances.trained(network, loss, steps, config.loop, "field of rays"), reads)
