"""The exact field of a sphere, and clouds of it."""

import dataclasses

import torch

from ddf.fields import cloud_projection, pddf

CONFIG = cloud_projection.CloudConfig(  # the paper's way
    num_directions=128, cycles=3, jitter=0.0, recheck=(), spread=None, temperature=0.05, inverse_depth=0.01
)
RADIUS = 0.6


SPREAD = dataclasses.replace(CONFIG, num_directions=64, spread=2.0)


class Sphere(pddf.PDDF):
    """Exact field of a sphere (hits from inside too) in the raw outputs of a PDDF; its radius may be the modulation."""

    def __init__(self):
        super().__init__(pddf.PDDFConfig((4,), 1.0, 1.0, "relu", 1.0))
        self.queries = 0

    def forward(self, positions, directions, modulations=None):
        self.queries += positions[..., 0].numel()
        radius = RADIUS if modulations is None else modulations[0].squeeze(-1)
        along = -(positions * directions).sum(-1)
        miss_sq = positions.square().sum(-1) - along.square()
        half = (radius**2 - miss_sq).clamp_min(0).sqrt()
        outside = positions.norm(dim=-1) > radius
        distance = torch.where(outside, along - half, along + half)
        visible = (miss_sq < radius**2) & (distance >= 0)
        depth = torch.where(visible, distance, torch.ones_like(distance))
        logit = torch.where(visible, 20.0, -20.0)
        return torch.stack((depth, depth, torch.ones_like(depth), logit), dim=-1)


def sample(count, config=CONFIG, seed=0, field=None):
    return cloud_projection.sample(field or Sphere(), None, count, config, torch.Generator().manual_seed(seed))


def projected(points, visibility):
    return cloud_projection.ProjectedPoints(points, visibility, visibility)
