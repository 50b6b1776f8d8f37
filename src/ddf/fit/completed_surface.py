"""What a completed shape is like where nothing saw it: its field, its cloud, and how far the truth may be off."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ddf.core import storage
from ddf.fields import cloud_projection, field_file, pddf, rendering, shape_field, stored_fields
from ddf.fit import completion
from ddf.geometry import neighbours, rays, scans

_REACH = 2.0  # of the median spacing of hits: a point nearer to a hit was seen
_ASKED_FROM = 0.3  # half longest sides before a point
_SIDES = 12  # from which a point is looked at, to find one that sees it
_DRAWS = 4  # of a shape's own blur, for an interval
_CHUNK = 8192  # rays at a time
DEVIATION = 0.683  # share of an interval of plus and minus one deviation


@dataclass(frozen=True)
class Cloud:
    """In the frame of the scan. seen: near a hit, the rest is inferred. spread: deviation of the distance at which a
    ray that looks at the point would find the surface; NaN where too few of the shapes left open are seen there.
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
    drawn, generator = stored_fields.cloud_config(), torch.Generator().manual_seed(seed)
    cycles = cloud_projection.sample(network, found.modulations, count, drawn, generator)
    (points,) = cloud_projection.select(cycles, [count], drawn)
    hits = found.scan_from_field.inverse().apply(scan.points)
    hits = neighbours.Neighbours(hits[(np.abs(hits) <= rendering.CUBE_HALF).all(axis=-1)], "hits")
    reach = max(_REACH * float(np.median(hits.spacing())), 2 * found.width)
    seen = hits.dist_sq(neighbours.Neighbours(points.double().numpy(), "points")) <= reach**2
    low, high = intervals(network, found, *_looking(network, found, points), DEVIATION, seed)
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
    seed: int = 0,
) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
    """Where along rays of the field frame the surface is, with the probability `share` if there is one.

    From the shapes that the scan leaves open: of each a component by its weight, blurred by Laplace's density.

    Args:
      positions: in the cube.
    Returns:
      Lower and upper depth, field units; NaN where under half of the shapes are visible.
    """
    if not len(positions):
        return np.zeros(0), np.zeros(0)
    generator, low, high = torch.Generator().manual_seed(seed), [], []
    shapes = len(found.samples[0])
    for start in range(0, len(positions), max(1, _CHUNK // shapes)):
        part = slice(start, start + max(1, _CHUNK // shapes))
        asked = (values[part].expand(shapes, -1, -1) for values in (positions, directions))
        raw = network(*asked, found.samples)
        chances = torch.rand(_DRAWS, *raw.shape[:-1], 1, generator=generator)
        component = (chances > pddf.weights(raw).cumsum(-1)[..., :-1]).sum(-1)
        depths = network.depths(raw).expand(_DRAWS, *raw.shape[:-1], -1).gather(-1, component[..., None])[..., 0]
        even = torch.rand(depths.shape, generator=generator) - 0.5
        depths = depths - found.width * even.sign() * torch.log1p(-2 * even.abs())
        depths = torch.where(raw[..., pddf.VISIBILITY_ROW] >= 0, depths, torch.nan).flatten(0, 1)
        ends = torch.nanquantile(depths, torch.tensor([0.5 - share / 2, 0.5 + share / 2]), dim=0)
        few = depths.isfinite().float().mean(0) < 0.5
        low.append(ends[0].masked_fill(few, torch.nan))
        high.append(ends[1].masked_fill(few, torch.nan))
    return torch.cat(low).double().numpy(), torch.cat(high).double().numpy()


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


def save(shape: shape_field.ShapeField, folder: Path) -> None:
    """Write the field like `ddf fit` does, so that `ddf.load` reads the folder."""
    storage.save_tensors(folder / field_file.MODEL, shape.field.state_dict(), shape.record)
