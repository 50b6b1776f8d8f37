"""A depth renderer of one shape: images of its mesh, and the training, with or without what makes it a DDF.

[DDF22] app. `neurren`; the network is `fields.renderers`. Lengths are those of a shape whose longest side is 2.
"""

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from ddf.core import checks, provenance, seeding
from ddf.fields import derivatives, model_files
from ddf.fields.renderers import depth_renderer, image_properties
from ddf.geometry import cameras, raycast, rays, transforms
from ddf.geometry.mesh_io import Mesh
from ddf.models import loop_config
from ddf.training import training_loop

_HUBER = 0.02  # depth error from which on its loss grows linearly
_DEPTH = 5.0  # γ_d; that of visibility is 1


@dataclass(frozen=True)
class CameraRange:
    """Where cameras stand, uniformly: degrees, and radii in field units; each turned by up to `turn_deg` about each of
    three axes after it has looked at the middle.
    """

    azimuth_deg: tuple[float, float] = (0.0, 90.0)
    elevation_deg: tuple[float, float] = (0.0, 45.0)
    radius: tuple[float, float] = (2.5, 3.2)
    turn_deg: float = 5.0

    def draw(self, count: int, random: np.random.Generator) -> image_properties.Views:
        """Random cameras, float32."""
        angles = np.radians([random.uniform(*span, count) for span in (self.azimuth_deg, self.elevation_deg)])
        axes, positions = cameras.extrinsics(angles[0], angles[1], random.uniform(*self.radius, count))
        turns = np.radians(random.uniform(-self.turn_deg, self.turn_deg, (count, 3)))
        x, y, z = turns.T
        zero = np.zeros(count)
        skew = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(-1, 3, 3)
        turned = torch.from_numpy(axes) @ torch.linalg.matrix_exp(torch.from_numpy(skew)).mT
        return image_properties.Views(torch.from_numpy(positions).float(), turned.float())


@dataclass(frozen=True)
class Images:
    """What cameras see of a mesh: depth (0 where nothing is visible), visible, and normals that face back."""

    views: image_properties.Views
    depth: Float[Tensor, "n h w"]
    visible: Bool[Tensor, "n h w"]
    normals: Float[Tensor, "n h w 3"]


@dataclass(frozen=True)
class RendererConfig:
    """How a renderer is trained. images: of the training, `batch` of them in a step; regularised: how many of these
    the derivatives are asked for. eikonal, gradient: weights of the mean squares of `image_properties.loss`.
    """

    loop: loop_config.LoopConfig
    steps: int
    layout: depth_renderer.RendererLayout = field(default_factory=depth_renderer.RendererLayout)
    cameras: CameraRange = CameraRange()
    images: int = 1024
    batch: int = 8
    regularised: int = 2
    eikonal: float = 0.0
    gradient: float = 0.0

    def __post_init__(self) -> None:
        if not 1 <= self.regularised <= self.batch <= self.images or self.steps < 1:
            raise checks.InputError(
                "1 <= regularised <= batch <= images and steps >= 1 must hold;"
                f" got {self.regularised}, {self.batch}, {self.images} and {self.steps}"
            )


def cast(mesh: Mesh, views: image_properties.Views, size: int) -> Images:
    """Exact images; the mesh is moved and scaled as a field's is."""
    field_from_mesh = transforms.field_from_mesh(mesh.surface_vertices())
    scene = raycast.Scene(Mesh(field_from_mesh.apply(mesh.vertices), mesh.faces))
    directions = views.directions(size).double()
    positions = views.positions.double()[:, None, None].expand_as(directions)
    hits = raycast.cast(scene, rays.OrientedPoints(positions, directions))
    depth = torch.where(hits.visible, hits.depth, 0.0).float()
    return Images(views, depth, hits.visible, hits.normals.float())


def fit(mesh: Mesh, config: RendererConfig, out_dir: Path) -> depth_renderer.DepthRenderer:
    """Train a renderer of a mesh and write it to `out_dir`; a training that was stopped goes on there."""
    training_loop.prepare(config.loop)
    random = np.random.default_rng(config.loop.seed)
    seen = cast(mesh, config.cameras.draw(config.images, random), config.layout.image)
    renderer = depth_renderer.DepthRenderer(config.layout).to(model_files.device())

    def step_loss(step: int) -> tuple[Tensor, dict[str, Tensor]]:
        generator = torch.Generator().manual_seed(seeding.numbered(config.loop.seed, step))
        return _loss(renderer, seen, torch.randint(config.images, (config.batch,), generator=generator), config)

    identity = [config, mesh.vertices.tolist(), mesh.faces.tolist()]
    record = provenance.record(identity, config.loop.seed, (), "ddf.fit.renderer_fit") | {"kind": "depth_renderer"}
    groups = [{"params": list(renderer.parameters()), "weight_decay": 0.0}]  # so that AdamW is Adam
    training_loop.fit(renderer, groups, step_loss, config.steps, config.loop, out_dir, record, "depth renderer")
    return renderer.eval().requires_grad_(False)


def _loss(
    renderer: depth_renderer.DepthRenderer, seen: Images, which: Tensor, config: RendererConfig
) -> tuple[Tensor, dict[str, Tensor]]:
    """Loss of a step and its terms; derivatives are made only where a weight asks for them."""
    device = renderer.head.weight.device
    views = image_properties.Views(*(v[which].to(device) for v in (seen.views.positions, seen.views.axes)))
    depth, visible = seen.depth[which].to(device), seen.visible[which].to(device)
    count = config.regularised if config.eikonal or config.gradient else 0
    first, rest = (views.chosen(part) for part in (torch.arange(count), torch.arange(count, config.batch)))
    parts, terms, total = [], {}, torch.zeros((), device=device)
    if count:
        values, moved, turned = renderer.with_derivatives(first)
        parts.append(values)
        place = (slice(None), depth_renderer.DEPTH)
        directions = first.directions(config.layout.image)
        along, across = image_properties.loss(visible[:count], values[place], moved[place], turned[place], directions)
        terms |= {"eikonal": along.detach(), "gradient": across.detach()}
        total = config.eikonal * along + config.gradient * across
    if count < config.batch:
        parts.append(renderer(rest))
    raw = torch.cat(parts)
    off = nn.functional.huber_loss(raw[:, depth_renderer.DEPTH], depth, reduction="none", delta=_HUBER) / _HUBER
    logits = raw[:, depth_renderer.VISIBILITY]
    terms |= {
        "depth": (visible * off).mean(),
        "visibility": nn.functional.binary_cross_entropy_with_logits(logits, visible.to(logits)),
    }
    total = total + _DEPTH * terms["depth"] + terms["visibility"]
    return total, {name: value.detach() for name, value in terms.items()}


@torch.no_grad()
def render(renderer: depth_renderer.DepthRenderer, views: image_properties.Views) -> tuple[Images, dict[str, Tensor]]:
    """What the renderer sees, normals by Property II, and its residuals: |δ_p · v + 1|, and ‖δ_ω - d (v × δ_p)‖."""
    values, moved, turned = renderer.with_derivatives(views)
    depth, directions = values[:, depth_renderer.DEPTH], views.directions(renderer.layout.image)
    moved, turned = moved[:, depth_renderer.DEPTH], turned[:, depth_renderer.DEPTH]
    residuals = {
        "eikonal": image_properties.eikonal(moved, directions).abs(),
        "gradient": image_properties.gradient_consistency(depth, moved, turned, directions).norm(dim=-1),
    }
    visible = values[:, depth_renderer.VISIBILITY] >= 0
    return Images(views, depth, visible, derivatives.normals(moved, directions)), residuals


def errors(found: Images, residuals: dict[str, Tensor], true: Images) -> dict[str, float]:
    """Medians where both see the shape, in field units and degrees, and the share of pixels where only one does."""
    both = found.visible & true.visible
    cosine = (found.normals[both] * true.normals[both]).sum(-1).clamp(-1, 1)
    off = (found.depth[both] - true.depth[both]).abs()
    return {
        "depth": float(off.median()),
        "normals_deg": math.degrees(float(cosine.arccos().median())),
        "wrong": float((found.visible != true.visible).float().mean()),
        **{name: float(values[both].median()) for name, values in residuals.items()},
    }
