"""A field of rays: a network that reads a ray by one of `ray_inputs`; trained on rays, asked for depth and normals.

The network is that of the package, a sine network with two depths, weight and visibility, so that peers differ in what
they read alone. The loss is that of the package on values: depth of the mixture and cross-entropy of visibility.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from bench.rivals import ray_inputs, rival_training
from ddf.fields import derivatives, framed_field, losses, pddf
from ddf.fit import fit_settings, fitting, shape_samples
from ddf.geometry import rays
from ddf.training import training_loop


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
    reads: ray_inputs.RayInput

    def depth(self, p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"]) -> Float[Tensor, "n"]:
        """Along v from p; `inf` where nothing is seen, or only what lies behind p."""
        x, before = self.reads.read(p, v)
        raw = self.network.network(x)
        depth = before + self.network.depth(raw)
        return torch.where((pddf.visibility(raw) >= framed_field.SEEN) & (depth >= 0), depth, torch.inf)

    def normals(self, p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        """Unit, facing back, whether or not anything is seen."""
        found = derivatives.trace(self.network.network, self.reads.read(p, v)[0])
        chosen = pddf.heavier_rows(found.outputs) * self.network.depth_slopes(found.outputs)
        slope = derivatives.adjoint(self.network.network, found.slopes, chosen, slice(0, 6))
        return derivatives.normals(self.reads.gradient(p, v, slope), v)


@dataclass(frozen=True)
class Lesson:
    """What a training reads of some rays: x, f, and whether anything is visible."""

    features: Float[Tensor, "n 6"]
    depth: Float[Tensor, "n"]
    visible: Float[Tensor, "n"]

    @classmethod
    def of(cls, reads: ray_inputs.RayInput, seen: SeenRays) -> "Lesson":
        """All of them, once."""
        p, v, visible = seen.positions, seen.directions, seen.truth.visible
        x, before = reads.read(p, v)
        return cls(x, torch.where(visible, seen.truth.depth.to(p) - before, 0.0), visible.to(p))


def fit(
    reads: ray_inputs.RayInput, lessons: Sequence[SeenRays], config: fit_settings.FitConfig, batch: int, steps: int
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

    return RayField(rival_training.trained(network, loss, steps, config.loop, "field of rays"), reads)
