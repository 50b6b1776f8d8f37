"""Scenes of 1 to 64 objects, with and without box culling: queries per pixel, ms per image, error of depth.

Objects stand apart on a lattice, turned and scaled at random (seeded): spheres and boxes in closed form, and the same
scene of small networks of one size with random weights, whose cost is that of fitted ones. Errors of the closed forms
are against the nearest of all objects, cast one by one in the world's frame, for the soft depth of [DDF22] and for the
hard choice; those of the networks, soft only, against the same scene in float64 without culling.
"""

import copy
import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from scipy.spatial import transform
from torch import Tensor

from bench.lib import display, growth_curves, measuring
from ddf.fields import pddf
from ddf.fields.scenes import composition
from ddf.geometry import cameras, primitives, transforms

THREADS, REPEATS, PIXELS = 2, 15, 64
COUNTS = (1, 4, 16, 64)
TEMPERATURE, INVERSE_DEPTH = 3e-3, 0.05
HIDDEN = (96, 96, 96)
MARGIN = 1.05  # boxes a little larger than the closed forms
HALF = (1.0, 0.4, 0.7)  # sides of the closed box
SHAPES: tuple[primitives.Primitive, ...] = (primitives.Sphere(), primitives.Box((-HALF[0], -HALF[1], -HALF[2]), HALF))


def placements(count: int) -> list[transforms.Similarity]:
    """World from object: cells of a cube of side 2 about the origin, filled in random order."""
    rng = np.random.default_rng(0)
    side = round(count ** (1 / 3) + 0.499)
    cells = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    chosen = rng.permutation(cells)[:count]
    turns = transform.Rotation.random(count, rng=rng).as_matrix()
    scales = rng.uniform(0.6, 0.75, count) / side / MARGIN
    centres = (2 * chosen + 1) / side - 1
    return [transforms.Similarity(s, r, c) for s, r, c in zip(scales, turns, centres, strict=True)]


def scene(count: int, query: Callable[[int], composition.Query]) -> list[composition.Placed]:
    """Objects of the scene; every second is a box, or a network in its place."""
    placed = []
    for i, world in enumerate(placements(count)):
        x, y, z = (MARGIN * half for half in ((1.0, 1.0, 1.0), HALF)[i % len(SHAPES)])
        placed.append(composition.Placed(query(i), world.inverse(), (-x, -y, -z), (x, y, z)))
    return placed


def camera_rays() -> tuple[Tensor, Tensor]:
    """Starts and directions of one camera, float64, world frame; it sees the whole cube."""
    azimuth, elevation, radius = torch.tensor([0.7, 0.4, 4.5], dtype=torch.float64)
    pixels = cameras.pixel_directions(PIXELS, torch.zeros(0, dtype=torch.float64)).reshape(-1, 3)
    centre, world = cameras.pixel_rays(azimuth, elevation, radius, pixels)
    return centre.expand_as(world).contiguous(), world


def exact_depth(count: int, positions: Tensor, directions: Tensor) -> Tensor:
    """The least depth over all objects, each met without its box."""
    best = torch.full((len(positions),), torch.inf, dtype=torch.float64)
    for i, world in enumerate(placements(count)):
        inner = world.inverse()
        starts = torch.from_numpy(inner.apply(positions.numpy()))
        depth, _ = SHAPES[i % len(SHAPES)].first(starts, torch.from_numpy(inner.apply_directions(directions.numpy())))
        best = torch.minimum(best, depth * world.scale)
    return best


def soft_error(found: composition.Composite, depth: Tensor) -> dict[str, float]:
    """Of the soft depth, where both are finite."""
    both = torch.isfinite(found.depth) & torch.isfinite(depth)
    return {"soft_depth_mean": float((found.depth - depth)[both].abs().mean())}


def hard_errors(found: composition.Composite, depth: Tensor) -> dict[str, float]:
    """Of the nearest depth where both are finite, and the share of rays where only one is."""
    seen, truth = torch.isfinite(found.nearest_depth), torch.isfinite(depth)
    off = (found.nearest_depth - depth)[seen & truth].abs()
    return {"nearest_depth_max": float(off.max()), "wrong_visibility": float((seen != truth).double().mean())}


@dataclasses.dataclass(frozen=True)
class Image:
    """One way of composing one scene: a row."""

    what: str
    objects: Sequence[composition.Placed]
    cull: bool
    error: Callable[[composition.Composite], dict[str, float]]

    @property
    def size(self) -> dict[str, Any]:
        """As in the row."""
        return {"objects": len(self.objects), "culling": self.cull, "pixels_a_side": PIXELS}

    def compose(self, rays: tuple[Tensor, Tensor]) -> composition.Composite:
        """What is timed."""
        return composition.compose(self.objects, *rays, TEMPERATURE, INVERSE_DEPTH, self.cull)


def images(count: int, rays: tuple[Tensor, Tensor], network: pddf.PDDF, precise: pddf.PDDF) -> list[Image]:
    """Closed forms and networks of so many objects, with and without culling."""
    closed = scene(count, lambda i: primitives.query_of(SHAPES[i % len(SHAPES)]))
    truth = exact_depth(count, *rays)
    slow = scene(count, lambda _: pddf.query_of(precise))
    exact = composition.compose(slow, *rays, TEMPERATURE, INVERSE_DEPTH, cull=False).depth
    fast = scene(count, lambda _: pddf.query_of(network))
    return [
        Image(what, objects, cull, error)
        for what, objects, error in (
            ("closed forms", closed, lambda found: soft_error(found, truth) | hard_errors(found, truth)),
            ("networks", fast, lambda found: soft_error(found, exact)),
        )
        for cull in (True, False)
    ]


SECTION = display.Section(views=())  # ways with the same error: their growth is drawn


def main() -> None:
    """Closed forms and networks at every number of objects, all in turn."""
    torch.set_num_threads(THREADS)
    rays = camera_rays()
    torch.manual_seed(0)
    network = pddf.PDDF(pddf.PDDFConfig(HIDDEN, 3.0, 1.0, "softplus", 100.0)).requires_grad_(False)
    precise = copy.deepcopy(network).double()
    chosen = [image for count in COUNTS for image in images(count, rays, network, precise)]
    ways = {f"{image.what}, {image.size}": (lambda image=image: image.compose(rays)) for image in chosen}
    rows = []
    for image, seconds in zip(chosen, measuring.interleaved(ways, REPEATS).values(), strict=True):
        found = image.compose(rays)
        row = measuring.row(image.what, image.size, seconds, image.error(found))
        rows.append({**row, "queries_per_pixel": found.queries / PIXELS**2})
    draw(rows)
    measuring.write("composition", THREADS, rows)


def draw(rows: Sequence[Mapping[str, Any]]) -> None:
    """ms per image against the number of objects, with and without culling."""
    panels: dict[str, dict[str, list[tuple[float, float]]]] = {}
    for row in rows:
        line = "boxes culled" if row["size"]["culling"] else "every object asked"
        point = (row["size"]["objects"], 1e3 * row["median_s"])
        panels.setdefault(row["what"], {}).setdefault(line, []).append(point)
    growth_curves.draw("composition", [(title, "objects", lines) for title, lines in panels.items()], "ms per image")
