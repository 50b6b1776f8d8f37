"""How fields of rays describe a ray to a network: our (p, v), and what peers do from outside a shape.

Letters: p + t v a ray, |v| = 1; R the radius of a sphere about the origin that holds the box; x(p, v) the six numbers
that the network reads, f(x) >= 0 its depth, d = t_0(p, v) + f(x) the depth of the ray. d is the same function of the
ray whichever point of it p is, but for the way to that point, so that v · ∇_p d = -1 holds by construction. The normal
is n = ∇_p d/‖∇_p d‖ (Property II of [DDF22] §3.1), and ∇_p d = ∇_p t_0 + (∂x/∂p)^T ∇_x f is written out for each
(derived here).

Sources: Sitzmann et al. 2021, "Light field networks" (Plücker coordinates; their network gives colour, ours depth);
Liu et al. 2023, "RayDF" (entry and exit of a sphere; theirs as angles, ours as points, which have no poles); Feng et
al. 2022, "PRIF" and Sundt and Theoharis 2023, "MARF" (foot of the perpendicular; depth from there, with its sign).

A field of rays has the package's sine network and loss on values, so that peers differ in what they read alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

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


class RayInput(Protocol):
    """A description of rays that meet the box."""

    def read(self, p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"]) -> tuple[Float[Tensor, "n 6"], Float[Tensor, "n"]]:
        """x, and t_0: where on the ray depth is counted from, negative behind p."""
        ...

    def gradient(
        self, p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"], slope: Float[Tensor, "n 6"]
    ) -> Float[Tensor, "n 3"]:
        """∇_p d, from slope = ∇_x f."""
        ...


def _dot(a: Float[Tensor, "n 3"], b: Float[Tensor, "n 3"]) -> Float[Tensor, "n 1"]:
    return (a * b).sum(-1, keepdim=True)


@dataclass(frozen=True)
class BoxEntry:
    """Ours: (e, v) with e = p + t_0 v, where the ray enters the box, or p itself inside it.

    Outside, t_0 = (c_k - p_k)/v_k on the side k = c_k that is entered, so ∇_p t_0 = -e_k/v_k, and
    ∇_p d = g + (1 + v · g) ∇_p t_0 with g = ∇_e f; inside it is g.
    """

    lower: Float[Tensor, "3"]
    upper: Float[Tensor, "3"]

    def read(self, p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"]) -> tuple[Float[Tensor, "n 6"], Float[Tensor, "n"]]:
        """(e, v), and the way to the box, 0 inside."""
        entry, way, _ = rays.enter_box(p, v, self.lower, self.upper)
        return torch.cat((entry, v), dim=-1), way

    def gradient(
        self, p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"], slope: Float[Tensor, "n 6"]
    ) -> Float[Tensor, "n 3"]:
        """By the side that is entered: the one that is met last."""
        g = slope[:, :3]
        met = torch.where(v > 0, self.lower - p, self.upper - p) / v
        met = torch.where(v == 0, -torch.inf, met)
        last, side = met.max(dim=-1, keepdim=True)
        way = torch.zeros_like(p).scatter(-1, side, -1 / v.gather(-1, side))
        return torch.where(last > 0, g + (1 + _dot(v, g)) * way, g)


@dataclass(frozen=True)
class Plucker:
    """(m, v) with the moment m = p × v; t_0 = -p · v - R, so ∇_p d = v × ∇_m f - v."""

    radius: float

    def read(self, p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"]) -> tuple[Float[Tensor, "n 6"], Float[Tensor, "n"]]:
        """(m, v), from R before the foot."""
        return torch.cat((torch.linalg.cross(p, v), v), dim=-1), -_dot(p, v)[:, 0] - self.radius

    def gradient(
        self, p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"], slope: Float[Tensor, "n 6"]
    ) -> Float[Tensor, "n 3"]:
        """v × ∇_m f - v."""
        return torch.linalg.cross(v, slope[:, :3]) - v


@dataclass(frozen=True)
class TwoSpheres:
    """(a, b), where the line enters and leaves the sphere; t_0 = t_a.

    t_a, t_b = -p · v ∓ sqrt((p · v)² - |p|² + R²). From |p + t v| = R: ∇_p t_a = -a/(a · v), likewise t_b, so
    ∇_p d = g_a + g_b + (1 + v · g_a) ∇_p t_a + (v · g_b) ∇_p t_b.
    """

    radius: float

    def read(self, p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"]) -> tuple[Float[Tensor, "n 6"], Float[Tensor, "n"]]:
        """(a, b), from a; both are the foot where the line misses the sphere."""
        along = _dot(p, v)
        half = (along.square() - _dot(p, p) + self.radius**2).clamp(min=0).sqrt()
        first, last = -along - half, -along + half
        return torch.cat((p + first * v, p + last * v), dim=-1), first[:, 0]

    def gradient(
        self, p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"], slope: Float[Tensor, "n 6"]
    ) -> Float[Tensor, "n 3"]:
        """By both ends; not finite where the ray only touches the sphere."""
        a, b = self.read(p, v)[0].split(3, dim=-1)
        g_a, g_b = slope.split(3, dim=-1)
        to_a, to_b = -a / _dot(a, v), -b / _dot(b, v)
        return g_a + g_b + (1 + _dot(v, g_a)) * to_a + _dot(v, g_b) * to_b


@dataclass(frozen=True)
class Foot:
    """(q, v) with q = p - (p · v) v, the point of the line nearest the origin; the network's f - R is signed.

    t_0 = -p · v - R, so ∇_p d = (I - v v^T) ∇_q f - v.
    """

    radius: float

    def read(self, p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"]) -> tuple[Float[Tensor, "n 6"], Float[Tensor, "n"]]:
        """(q, v), from R before the foot."""
        along = _dot(p, v)
        return torch.cat((p - along * v, v), dim=-1), -along[:, 0] - self.radius

    def gradient(
        self, p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"], slope: Float[Tensor, "n 6"]
    ) -> Float[Tensor, "n 3"]:
        """(I - v v^T) ∇_q f - v."""
        g = slope[:, :3]
        return g - (1 + _dot(v, g)) * v


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
        x, before = self.reads.read(p, v)
        raw = self.network.network(x)
        depth = before + self.network.depth(raw)
        return torch.where((pddf.visibility(raw) >= framed_field.SEEN) & (depth >= 0), depth, torch.inf)

    def normals(self, p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        """Unit, facing back, whether or not anything is seen."""
        network = self.network.network
        found = derivatives.trace(network, self.reads.read(p, v)[0])
        chosen = pddf.heavier_rows(found.outputs) * self.network.depth_slopes(found.outputs)
        states, _ = derivatives.adjoint_states(network, found.slopes, chosen)
        slope = (states[0] * found.slopes[0]) @ network.layers[0].weight  # in all six numbers
        return derivatives.normals(self.reads.gradient(p, v, slope), v)


@dataclass(frozen=True)
class Lesson:
    """What a training reads of some rays: x, f, and whether anything is visible."""

    features: Float[Tensor, "n 6"]
    depth: Float[Tensor, "n"]
    visible: Float[Tensor, "n"]

    @classmethod
    def of(cls, reads: RayInput, seen: SeenRays) -> "Lesson":
        """All of them, once."""
        p, v, visible = seen.positions, seen.directions, seen.truth.visible
        x, before = reads.read(p, v)
        return cls(x, torch.where(visible, seen.truth.depth.to(p) - before, 0.0), visible.to(p))


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
    learnt = [Lesson.of(reads, seen) for seen in lessons]
    everything = {f"{index}": {"depth": part.depth, "visible": part.visible} for index, part in enumerate(learnt)}
    fitting.start_flat(network, shape_samples.ShapeSamples(everything, np.zeros(3), np.zeros(3)))

    def loss(step: int) -> tuple[Tensor, dict[str, Tensor]]:
        random = np.random.default_rng((config.loop.seed, step))
        rows = [torch.from_numpy(random.integers(0, len(part.depth), batch // len(learnt))) for part in learnt]
        chosen = [(part, index) for part, index in zip(learnt, rows, strict=True)]
        raw = network.network(torch.cat([part.features[index] for part, index in chosen]))
        visible = torch.cat([part.visible[index] for part, index in chosen])
        truth = torch.cat([part.depth[index] for part, index in chosen])
        depth = losses.depth_loss(network, raw, truth, visible, config.weights).mean()
        seen = functional.binary_cross_entropy_with_logits(raw[:, pddf.VISIBILITY_ROW], visible)
        return config.weights.depth * depth + config.weights.visibility * seen, {"depth": depth.detach()}

    return RayField(distances.trained(network, loss, steps, config.loop, "field of rays"), reads)
