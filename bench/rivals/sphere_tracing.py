"""The rival of a DDF render: a signed-distance network of the same size, and sphere tracing through it.

Letters: f signed distance (negative inside), p + t v the ray, r = |f| the sphere that holds no surface.
Sources: Hart 1996, "Sphere tracing"; Gropp et al. 2020, "Implicit geometric regularization" (‖∇f‖ = 1).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from bench.rivals import rival_training
from ddf.core import seeding
from ddf.data.samples.draws import Surface
from ddf.fields import derivatives, siren
from ddf.geometry import raycast, rays
from ddf.geometry.mesh_io import Mesh
from ddf.models import loop_config
from ddf.training import training_loop

Distance = Callable[[Tensor], Tensor]  # points (n, 3) to f (n)


@dataclass(frozen=True)
class Tracing:
    """How far and how finely to march.

    max_steps: network queries of one ray, at most. threshold: f below which a ray has arrived. within: f below which a
    ray that ran out of steps still counts as arrived. chunk: rays marched together, speed and memory only.
    """

    max_steps: int
    threshold: float
    within: float
    chunk: int = 4096


def trace(
    distance: Distance,
    starts: Float[Tensor, "n 3"],
    directions: Float[Tensor, "n 3"],
    lower: Float[Tensor, "3"],
    upper: Float[Tensor, "3"],
    how: Tracing,
) -> tuple[Float[Tensor, "n"], int]:
    """Depth along each ray from its start, `inf` on a miss, and the number of queries; the surface lies in the box.

    Rays enter the box first and are given up where they leave it; those that miss it cost nothing.
    """
    entry, leave = rays.box_span(starts, directions, lower, upper)
    meets = torch.nonzero(entry <= leave).squeeze(-1)
    depth, queries = torch.full_like(entry, torch.inf), 0
    for chosen in meets.split(how.chunk):
        depth[chosen], spent = _march(distance, starts[chosen], directions[chosen], entry[chosen], leave[chosen], how)
        queries += spent
    return depth, queries


def _march(
    distance: Distance,
    starts: Float[Tensor, "n 3"],
    directions: Float[Tensor, "n 3"],
    entry: Float[Tensor, "n"],
    leave: Float[Tensor, "n"],
    how: Tracing,
) -> tuple[Float[Tensor, "n"], int]:
    """One chunk; only rays that are still under way are queried."""
    depth, left, queries = torch.full_like(entry, torch.inf), torch.arange(len(entry)), 0
    t = entry
    for index in range(how.max_steps):
        f = distance(torch.addcmul(starts, t[:, None], directions))
        queries += len(f)
        arrived = f < (how.threshold if index < how.max_steps - 1 else how.within)
        t = t + f
        depth[left[arrived]] = t[arrived]
        on = torch.nonzero(~arrived & (t <= leave)).squeeze(-1)
        if not len(on):
            break
        left, starts, directions, leave, t = left[on], starts[on], directions[on], leave[on], t[on]
    return depth, queries


@dataclass(frozen=True)
class DistanceConfig:
    """A signed-distance network and its training.

    points: drawn, half of them near the surface (normal distances of `spreads`), half uniform in the box; batch: of
    them in a step. eikonal: weight of (‖∇f‖ - 1)² beside |f - truth|.
    """

    layout: siren.SineLayout
    loop: loop_config.LoopConfig
    points: int = 400_000
    batch: int = 4096
    spreads: tuple[float, ...] = (0.005, 0.05)
    eikonal: float = 0.05


def signed_distances(scene: raycast.Scene, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
    """f of a closed mesh, in its unit: Open3D's nearest triangle, its distance in float64, sign by parity."""
    return scene.distance(points) * np.where(scene.outside(points), 1.0, -1.0)


def fit_distance(mesh: Mesh, config: DistanceConfig, steps: int) -> siren.SineNetwork:
    """A network for f of a closed mesh."""
    training_loop.prepare(config.loop)
    random = seeding.generator(config.loop.seed, "sphere_tracing")
    lower, upper = mesh.box()
    near, _ = Surface.of(mesh).draw(config.points // 2, random)
    spread = np.resize(config.spreads, len(near))[:, None]
    near = near + spread * random.standard_normal(near.shape)
    drawn = np.concatenate([near, random.uniform(lower, upper, (config.points - len(near), 3))])
    truth = torch.from_numpy(signed_distances(raycast.Scene(mesh), drawn)).float()
    points = torch.from_numpy(drawn).float()
    network = siren.SineNetwork(3, config.layout, 1)

    def loss(step: int) -> tuple[Tensor, dict[str, Tensor]]:
        rows = torch.from_numpy(np.random.default_rng((config.loop.seed, step)).integers(0, len(points), config.batch))
        found = derivatives.trace(network, points[rows])
        gradient = derivatives.adjoint(network, found.slopes, torch.ones(len(rows), 1))
        error = (found.outputs.squeeze(-1) - truth[rows]).abs().mean()
        eikonal = (gradient.norm(dim=-1) - 1).square().mean()
        return error + config.eikonal * eikonal, {"error": error.detach(), "eikonal": eikonal.detach()}

    return rival_training.trained(network, loss, steps, config.loop, "signed distance")
