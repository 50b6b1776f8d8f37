"""What a completed shape is like where nothing saw it: its field, its cloud, and how far the truth may be off."""

import math
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ddf.fields import cloud_projection, pddf, rendering, shape_field
from ddf.fit import completion
from ddf.geometry import neighbours, rays, scans

_REACH = 2.0  # of the median spacing of hits: a point nearer to a hit was seen
_ASKED_FROM = 0.3  # half longest sides before a point
_SIDES = 12  # from which a point is looked at, to find one that sees it
_WIDER, _FARTHER = 0.25, 5.0  # share of errors that are so many times wider than the others, on validation scans
_FAINTEST = 1e-3  # a shape that a ray seems to miss counts as much as one of that visibility, at least
_HALVINGS = 24  # of what holds the end of an interval
_CHUNK = 8192  # rays at a time
DEVIATION = 0.683  # share of an interval of plus and minus one deviation


@dataclass(frozen=True)
class Cloud:
    """In the frame of the scan. seen: near a hit, the rest is inferred. spread: deviation of the distance at which a
    ray that looks at the point would find the surface.
    """

    points: Float[np.ndarray, "n 3"]
    seen: Bool[np.ndarray, "n"]
    spread: Float[np.ndarray, "n"]


def field(network: pddf.PDDF, found: completion.Completed) -> shape_field.ShapeField:
    """The shape alone, in the frame of the scan: modulations go into the weights that read the layers they scale."""
    upper = np.full(3, rendering.CUBE_HALF)
    record = shape_field.description(network.config, -upper, upper, found.scan_from_field.inverse())
    return shape_field.ShapeField(
        pddf.baked(network, found.modulations), -upper, upper, found.scan_from_field.inverse(), record
    )


@torch.no_grad()
def cloud(network: pddf.PDDF, found: completion.Completed, scan: scans.Scan, count: int, seed: int = 0) -> Cloud:
    """Points of the surface, which of them were seen, and how sure all are."""
    drawn, generator = cloud_projection.USUAL, torch.Generator().manual_seed(seed)
    cycles = cloud_projection.sample(network, found.modulations, count, drawn, generator)
    (points,) = cloud_projection.select(cycles, [count], drawn)
    hits = found.scan_from_field.inverse().apply(scan.points)
    hits = neighbours.Neighbours(hits[(np.abs(hits) <= rendering.CUBE_HALF).all(axis=-1)], "hits")
    reach = max(_REACH * float(np.median(hits.spacing())), 2 * found.width)
    seen = hits.dist_sq(neighbours.Neighbours(points.double().numpy(), "points")) <= reach**2
    low, high = intervals(network, found, *_looking(network, found, points), DEVIATION)
    return Cloud(
        found.scan_from_field.apply(points.double().numpy()), seen, (high - low) / 2 * found.scan_from_field.scale
    )


def _looking(
    network: pddf.PDDF, found: completion.Completed, points: Float[Tensor, "n 3"]
) -> tuple[Float[Tensor, "n 3"], Float[Tensor, "n 3"]]:
    """For each point of the cube a ray that sees it: of those from evenly spread sides the one that agrees best."""
    best, along = torch.full(points.shape[:1], torch.inf), torch.zeros_like(points)
    for side in torch.from_numpy(rays.evenly_spread(_SIDES)).to(points):
        raw = network(points - _ASKED_FROM * side, side.expand_as(points), found.modulations)
        off = (network.depth(raw) - _ASKED_FROM).abs() + (raw[:, pddf.VISIBILITY_ROW] < 0)
        along[off < best], best = side, torch.minimum(off, best)
    return points - _ASKED_FROM * along, along


@torch.no_grad()
def intervals(
    network: pddf.PDDF,
    found: completion.Completed,
    positions: Float[Tensor, "n 3"],
    directions: Float[Tensor, "n 3"],
    share: float,
) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
    """Where along rays of the field frame the surface is, with the probability `share` if there is one.

    From the shapes that the scan leaves open: of each the components by their weights and by its visibility, blurred by
    the scatter of the scan's own hits. Positions are in the cube, lower and upper depths in field units.
    """
    low, high, shapes = [], [], len(found.samples[0])
    edges = torch.tensor([[1 - share], [1 + share]]).to(positions) / 2
    reach = -_FARTHER * found.scatter * math.log((1 - share) / 2)
    for part in torch.arange(len(positions)).split(max(1, _CHUNK // shapes)):
        asked = (values[part].expand(shapes, -1, -1) for values in (positions, directions))
        raw = network(*asked, found.samples)
        weights = pddf.weights(raw) * (torch.sigmoid(raw[..., pddf.VISIBILITY_ROW, None]) + _FAINTEST)
        weights, depths = weights / weights.sum((0, 2), keepdim=True), network.depths(raw)
        lower, upper = (each.expand(2, -1) for each in (depths.amin((0, 2)) - reach, depths.amax((0, 2)) + reach))
        for _ in range(_HALVINGS):
            middle = (lower + upper) / 2
            below = (weights * _share_below(middle[:, None, :, None] - depths, found.scatter)).sum((1, 3)) < edges
            lower, upper = torch.where(below, middle, lower), torch.where(below, upper, middle)
        low.append(lower[0].clamp_min(0))
        high.append(upper[1].clamp_min(0))
    return tuple(torch.cat([positions.new_zeros(0), *each]).double().numpy() for each in (low, high))  # type: ignore


def _share_below(off: Tensor, width: float) -> Tensor:
    """Of the blur: Laplace's distribution, which is wider for some of the errors."""

    def below(scale: float) -> Tensor:
        return torch.where(off < 0, (off / scale).exp() / 2, 1 - (-off / scale).exp() / 2)

    return (1 - _WIDER) * below(width) + _WIDER * below(_FARTHER * width)


def along_rays(
    network: pddf.PDDF,
    found: completion.Completed,
    positions: Float[np.ndarray, "n 3"],
    directions: Float[np.ndarray, "n 3"],
    share: float,
) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
    """`intervals` of rays of the scan's frame, in its unit; NaN where the cube is missed, too."""
    inverse = found.scan_from_field.inverse()
    along = inverse.apply_directions(directions)
    corner = np.full(3, rendering.CUBE_HALF)
    entry, way, meets = rays.enter_box(inverse.apply(positions), along, -corner, corner)
    starts, looking = (torch.from_numpy(values[meets]).to(network.network.head.weight) for values in (entry, along))
    both = np.full((2, len(meets)), np.nan)
    both[:, meets] = intervals(network, found, starts, looking, share)
    low, high = (both + way) * found.scan_from_field.scale
    return low, high
