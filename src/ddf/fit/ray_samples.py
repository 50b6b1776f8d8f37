"""Samples of a shape from measured rays: what a network is fitted to where no surface is given.

A ray that ended on something tells its depth from every place on it, less by as much as the place is ahead; one that
went on, that nothing is met from any of its places. Of these the fit draws. No ray tells normals, nor what is seen
along a surface or from behind it, so these terms of the loss and these types of samples are left out.
Source: [DDF22] §1, pointwise depth data, and §3.1, property I: ∂d(p + s v, v)/∂s = -1.
"""

import dataclasses

import numpy as np

from ddf.core import checks
from ddf.data.samples import extraction
from ddf.fields import losses
from ddf.fit import shape_samples
from ddf.geometry import mesh_io, rays, scans, transforms

KIND = "A"  # as which the loss takes them: with depth, visibility and both eikonal terms


def weights(of_mesh: losses.LossWeights) -> losses.LossWeights:
    """Those of a fit to a mesh, but for what rays do not tell."""
    return dataclasses.replace(of_mesh, normals=0.0, transition=0.0)


def draw(
    scan: scans.Scan,
    surface: mesh_io.Mesh,
    field_from_scan: transforms.Similarity,
    config: extraction.SamplesConfig,
    count: int,
) -> shape_samples.ShapeSamples:
    """So many samples, float32, of the rays that cross the shape's box, field frame.

    Args:
      surface: that the hits have in common, field frame: the box is its own.
      config: of samples of a mesh: margin, box and seed.
    Raises:
      InputError: no ray crosses the box.
    """
    box, scale = extraction.box_of(surface, config), field_from_scan.scale
    starts, ways = field_from_scan.apply(scan.positions), field_from_scan.apply_directions(scan.directions)
    first, last = rays.box_span(starts, ways, box.lower, box.upper)
    ended = scale * scan.ranges < last
    end = np.minimum(scale * scan.ranges, last)
    (useful,) = np.nonzero(first < end)
    if not len(useful):
        raise checks.InputError("no ray crosses the box of what the rays hit")
    random = np.random.default_rng(config.seed)
    rows = useful[random.integers(0, len(useful), count)]
    along = first[rows] + random.random(count) * (end - first)[rows]
    visible = ended[rows].astype(np.float32)
    samples = {
        "positions": rays.surface_points(starts[rows], ways[rows], along).astype(np.float32),
        "directions": ways[rows].astype(np.float32),
        "visible": visible,
        "depth": (visible * (end[rows] - along)).astype(np.float32),
        "normals": np.zeros((count, 3), np.float32),
    }
    lower, upper = (side.astype(np.float64) for side in (box.lower, box.upper))
    return shape_samples.ShapeSamples({KIND: samples}, lower, upper, 1 - config.margin)
