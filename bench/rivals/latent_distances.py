"""A rival of `ddf complete`: signed distances for each latent, an auto-decoder, on which a scan descends.

f(p; z) is a sine network that z modulates, as large as the decoder of the DDF, trained for as long on the same
shapes, with a latent for each. Letters: f signed distance in the cube's unit, negative inside; δ where its error is
clamped; z = mean + basis u. Source: Park et al. 2019, "DeepSDF".

The sign is by escape: a point is outside if rays in two of `WAYS` directions meet nothing, so no mesh has to be closed.
A sheet has no inside, and f >= 0: so the surface is taken where f = `SKIN`, and moved back.
"""

import hashlib
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn
from torch.nn import functional

from bench.rivals import distances
from ddf.core import seeding, storage
from ddf.data import mesh_shards
from ddf.data.samples.draws import Surface
from ddf.fields import cloud_projection, derivatives, rendering, siren
from ddf.fit import completion, latent_prior
from ddf.geometry import neighbours, raycast, rays, scans, transforms, unsigned_surface
from ddf.geometry.mesh_io import Mesh
from ddf.models import loop_config, reconstruction_settings
from ddf.training import training_loop
from ddf_lab.run import Run

WAYS, SKIN, FREE, CHUNK = 32, 0.01, 20_000, 8192
NEAR = ((0.4, 0.01), (0.3, 0.05))  # shares of the points about the surface, and their deviations; the rest in the cube
CLAMP, BEYOND, NORM = 0.1, 0.1, 1e-4  # δ; weights of the error that is not clamped, and of |z|²
LOOP = loop_config.LoopConfig(5e-3, "cosine", 50, 1.0, threads=1, muon=0.02)


@dataclass(frozen=True)
class Training:
    """points: kept of a shape. shapes, rows: of a step, and points of each."""

    layout: siren.SineLayout
    latent_features: int
    steps: int
    points: int = 16384
    shapes: int = 24
    rows: int = 256


class LatentDistances(nn.Module):
    """f, and a latent for each training shape."""

    def __init__(self, config: Training, shapes: int) -> None:
        super().__init__()
        self.latents = nn.Parameter(0.1 * torch.randn(shapes, config.latent_features))
        self.modulator = siren.Modulator(config.latent_features, config.layout.hidden)
        self.network = siren.SineNetwork(3, config.layout, 1)

    def forward(self, latents: Float[Tensor, "b z"], points: Float[Tensor, "b n 3"]) -> Float[Tensor, "b n"]:
        """f of points of several shapes."""
        return self.network(points, self.modulator(latents))[..., 0]


def outside(scene: raycast.Scene, points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
    """Whether rays escape in two directions."""
    starts = np.repeat(scene.local(points), WAYS, axis=0)
    blocked = scene.blocked_local(starts, np.tile(rays.evenly_spread(WAYS), (len(points), 1)))
    return (~blocked).reshape(-1, WAYS).sum(axis=1) >= 2


def drawn(mesh: Mesh, count: int, rng: np.random.Generator) -> Float[np.ndarray, "count 4"]:
    """Points and their f."""
    surface, scene, parts = Surface.of(mesh), raycast.Scene(mesh), []
    for share, deviation in NEAR:
        near = surface.draw(round(share * count), rng)[0]
        parts.append(near + deviation * rng.standard_normal(near.shape))
    parts.append(rng.uniform(-1, 1, (count - sum(map(len, parts)), 3)))
    points = np.concatenate(parts).astype(np.float32)
    f = np.linalg.norm(scene.closest(points) - points, axis=1) * np.where(outside(scene, points), 1, -1)
    return np.column_stack([points, f]).astype(np.float32)


def of_run(run: Run, steps: int) -> LatentDistances:
    """Of a category of a run whose stage `meshes` is done; kept beside its artefacts, where a second call finds it."""
    train = run.section(reconstruction_settings.TrainConfig)
    config = Training(train.decoder, train.latent_features, steps)
    shapes = storage.read_json(run.index)["categories"][run.category]["shapes"]
    wanted = {shape["id"] for shape in shapes if shape["train_views"]}
    digest = hashlib.sha256(repr((config, storage.checksum(run.index))).encode()).hexdigest()
    folder = run.folder("sdf") / digest[:8]
    kept = folder / "points.safetensors"
    if not kept.is_file():
        meshes: dict[str, Mesh] = {}
        for pack in storage.shard_files(run.folder("meshes"), mesh_shards.SUFFIX, "meshes"):
            meshes |= {name: mesh for name, mesh in mesh_shards.read_pack(pack).meshes.items() if name in wanted}
        every = [drawn(mesh, config.points, seeding.generator(0, run.category, name)) for name, mesh in meshes.items()]
        storage.save_tensors(kept, {"points": np.stack(every)}, {"ids": list(meshes)})
    return trained(storage.map_tensors(kept)["points"], config, folder, f"{run.category}, signed distance")


def trained(
    points: Float[np.ndarray, "s n 4"], config: Training, kept: Path, describe: str = "signed distance"
) -> LatentDistances:
    """Of so many shapes; goes on from, or gives, what the folder holds."""
    training_loop.prepare(LOOP)
    model = LatentDistances(config, len(points))

    def loss(step: int) -> tuple[Tensor, dict[str, Tensor]]:
        rng = np.random.default_rng((LOOP.seed, step))
        shapes = rng.permutation(len(points))[: config.shapes]
        asked = torch.from_numpy(points[shapes[:, None], rng.integers(0, config.points, (len(shapes), config.rows))])
        latents, true = model.latents[shapes], asked[..., 3]
        f = model(latents, asked[..., :3])
        error = (f.clamp(-CLAMP, CLAMP) - true.clamp(-CLAMP, CLAMP)).abs().mean()
        beyond, norm = (f - true).abs().mean(), latents.square().sum(-1).mean()
        terms = {"error": error.detach(), "beyond": beyond.detach(), "norm": norm.detach()}
        return error + BEYOND * beyond + NORM * norm, terms

    return distances.trained(model, loss, config.steps, LOOP, describe, kept)


@dataclass(frozen=True)
class Evidence:
    """Of a scan, in the cube's frame: hits, and points of its rays before them, each with the way to the next hit."""

    hits: Float[Tensor, "n 3"]
    free: Float[Tensor, "m 3"]
    reach: Float[Tensor, "m"]

    @classmethod
    def of(cls, scan: scans.Scan, place: transforms.Similarity, rng: np.random.Generator) -> "Evidence":
        """Of a scan whose pose is known; `FREE` points before hits."""
        inverse = place.inverse()
        starts, along = inverse.apply(scan.positions), inverse.apply_directions(scan.directions)
        corner = np.full(3, rendering.CUBE_HALF)
        near, far = rays.box_span(starts, along, -corner, corner)
        end = np.minimum(far, inverse.scale_depth(scan.ranges))
        index = rng.choice(np.flatnonzero(near < end), FREE)
        way = near[index] + (end - near)[index] * rng.random(FREE)
        free = starts[index] + way[:, None] * along[index]
        hits = inverse.apply(scan.points)
        reach = np.sqrt(neighbours.Tree(hits).search(free, 1)[1][:, 0])
        return cls(*(torch.from_numpy(each).float() for each in (hits, free, reach)))


@dataclass(frozen=True)
class Completer:
    """A model, its prior, and how it descends: as `completion` does, but `rays` are points, half of them hits, and the
    draws are latents of training shapes, without their part beyond the axes.
    """

    model: LatentDistances
    prior: latent_prior.LatentPrior
    config: completion.CompletionConfig

    @classmethod
    def of(cls, model: LatentDistances, config: completion.CompletionConfig) -> "Completer":
        """The prior is that of the training shapes' latents."""
        latents = model.requires_grad_(False).latents
        prior = latent_prior.of_moments(latents.mean(0), torch.cov(latents.T.double())).widest(config.axes)
        return cls(model, prior, config)

    def complete(self, seen: Evidence, seed: int) -> Float[Tensor, "1 z"]:
        """The likeliest latent: Adam on |f| at hits and on what f is below 0 or above the way to a hit before them."""
        config, generator = self.config, torch.Generator().manual_seed(seed)
        u = self.prior.coordinates(self.model.latents)
        u = u[torch.randperm(len(u), generator=generator)[: config.draws]]
        u[0] = 0
        with torch.no_grad():
            batch = self._some(seen, config.rays // 2, generator)
            loss = torch.cat([self.loss(part, *batch) for part in u.split(32)])
        count, cut = config.starts, config.steps // 3
        for begin, end in ((0, cut), (cut, config.steps)):
            u = u[loss.topk(min(count, len(u)), largest=False).indices].clone().requires_grad_()
            optimiser = torch.optim.Adam([u], lr=config.rate, betas=(0.9, 0.99))
            for step in range(begin, end):
                optimiser.param_groups[0]["lr"] = config.rate * (1 + math.cos(math.pi * step / config.steps)) / 2
                optimiser.zero_grad()
                self.loss(u, *self._some(seen, config.rays, generator)).sum().backward()
                optimiser.step()
            u, count = u.detach(), config.kept
            with torch.no_grad():
                loss = self.loss(u, *self._some(seen, 2 * config.rays, generator))
        return self.prior.latents(u[loss.argmin()][None])

    def loss(
        self, u: Float[Tensor, "k axes"], hits: Float[Tensor, "n 3"], free: Float[Tensor, "m 3"], reach: Tensor
    ) -> Float[Tensor, "k"]:
        """Of each start."""
        f = self.model(self.prior.latents(u), torch.cat((hits, free)).expand(len(u), -1, -1))
        off, free_f = f[:, : len(hits)].abs(), f[:, len(hits) :]
        beyond = functional.relu(-free_f) + functional.relu(free_f - reach)
        return torch.cat((off, beyond), dim=1).mean(1) / self.config.blur + self.config.prior * u.square().sum(-1) / 2

    def _some(self, seen: Evidence, count: int, generator: torch.Generator) -> tuple[Tensor, Tensor, Tensor]:
        hits, free = (torch.randint(len(each), (count // 2,), generator=generator) for each in (seen.hits, seen.free))
        return seen.hits[hits], seen.free[free], seen.reach[free]


@torch.no_grad()
def cloud(
    model: LatentDistances, latent: Float[Tensor, "1 z"], count: int, rng: np.random.Generator
) -> Float[np.ndarray, "count 3"]:
    """Points spread evenly over where f = `SKIN`, moved back by it; InputError where it is nowhere."""
    modulations = [each[0] for each in model.modulator(latent)]

    def outward(positions: Float[np.ndarray, "n 3"]) -> tuple[Tensor, Tensor]:
        """How far a surface is, by f and its slope, and the way out."""
        found = []
        for part in torch.from_numpy(positions).float().split(CHUNK):
            traced = derivatives.trace(model.network, part, modulations)
            slope = derivatives.adjoint(model.network, traced.slopes, torch.ones(len(part), 1))
            length = slope.norm(dim=-1, keepdim=True).clamp_min(1e-6)
            found.append(torch.cat(((traced.outputs - SKIN) / length, slope / length), dim=-1).double())
        return torch.cat(found)[:, 0], torch.cat(found)[:, 1:]

    def ask(positions: Float[np.ndarray, "n 3"]) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n 3"]]:
        far, out = outward(positions)
        return far.abs().numpy(), (-far.sign()[:, None] * out).numpy()

    corner = np.full(3, 1.05 * rendering.CUBE_HALF)
    points, _ = Surface.of(unsigned_surface.extract(ask, -corner, corner)).draw(4 * count, rng)
    points = points[cloud_projection.farthest_point_order(torch.from_numpy(points).float(), count).numpy()]
    return points - SKIN * outward(points)[1].numpy()
