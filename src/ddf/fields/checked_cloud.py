"""Hits of random rays that a field confirms: a cloud for distances, drawn from whatever can be asked along rays.

From p ~ U[B] along v ~ U[S²] the field sees a surface at q = p + d v. It is asked again along the same ray from before
and from behind q, at `OFFSETS`: a hit stays where the answers agree on where it is. (Whether they also see it does not
count: on a fitted solid the inner side does not, and the hits are as good.) Last, each hit becomes a small disc in the
plane of the hits around it: what is left of the field's noise makes nearest hits too near, the gaps between hits make
them too far, and both turn v*.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ddf.core import checks
from ddf.fields import framed_field
from ddf.geometry import neighbours, rays

COUNT = 20_000
LEAST_VISIBILITY = 0.9
OFFSETS = (0.05, 0.1)  # of half the longest side of the box, as are the others
LARGEST_SPREAD = 0.015  # mean distance of the answers from their median
LARGEST_DISC = 1.5  # radius, in those of the median disc
PLANE_HITS = 16  # that a plane is laid through
_FIRST_BATCH, _LARGEST_BATCH, _MOST_BATCHES = 8192, 65_536, 40
_CHUNK = 2048  # rays at a time: what stays in a core's cache


@dataclass(frozen=True)
class Discs:
    """A noisy surface as small flat discs: centres, unit normals of either side, radii of about the points' spacing."""

    centres: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]
    radii: Float[np.ndarray, "n"]

    def foot(self, index: Int[np.ndarray, "m"], positions: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "m 3"]:
        """The point of a disc that is closest to a position, each position with its own disc."""
        centres, normals = self.centres[index], self.normals[index]
        away = positions - centres
        within = away - (away * normals).sum(axis=1, keepdims=True) * normals
        length = np.linalg.norm(within, axis=1)
        share = np.minimum(1.0, self.radii[index] / np.where(length > 0, length, 1.0))
        return centres + share[:, None] * within


def flat_discs(points: Float[np.ndarray, "n 3"], count: int) -> Discs:
    """Each point moved onto the plane of least squares through its `count` nearest, itself included, with that plane.

    Noise of independent points falls as 1/sqrt(count); a surface of curvature κ moves by about κ r²/4, with r the
    reach of the neighbours. A disc's area is twice a point's share of these, so that discs overlap, and at most
    `LARGEST_DISC`² times the usual: a stray point has no neighbours to lie in one plane with. Of `count` points or
    fewer, radii are 0.
    """
    if len(points) <= count:
        return Discs(points, np.zeros_like(points), np.zeros(len(points)))
    index, dist_sq = neighbours.tree(points).search(points, count)
    around = points[index]
    centre = around.mean(axis=1)
    offsets = around - centre[:, None]
    normals = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets, offsets))[1][:, :, 0]
    onto = points - ((points - centre) * normals).sum(axis=1, keepdims=True) * normals
    radii = np.sqrt(2 * dist_sq.max(axis=1) / count)
    return Discs(onto, normals, np.minimum(radii, LARGEST_DISC * np.median(radii)))


class CheckedCloud:
    """Hits as small discs, for distances. hits: their centres, in the frame of whoever made them."""

    def __init__(self, discs: Discs) -> None:
        self.hits, self._discs = discs.centres, discs
        self._near = neighbours.Neighbours(discs.centres, "hits")

    def distances(self, positions: Float[np.ndarray, "n 3"]) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n 3"]]:
        """To the disc of the nearest hit, and the unit directions there, 0 where the distance is 0."""
        if len(positions) == 0:
            return np.zeros(0), np.zeros((0, 3))
        _, index = self._near.nearest(positions, "positions")
        ways = self._discs.foot(index, positions) - positions
        distances = np.linalg.norm(ways, axis=1)
        return distances, ways / np.where(distances == 0, 1.0, distances)[:, None]


def draw(field: framed_field.FramedField, count: int = COUNT, seed: int = 0) -> CheckedCloud:
    """Confirmed hits, mesh frame; fewer than `count` where the field confirms few.

    Raises:
      InputError: the field confirms none.
    """
    random, found, total, batch, asked = np.random.default_rng(seed), [], 0, _FIRST_BATCH, 0
    for _ in range(_MOST_BATCHES):
        found.append(_confirmed(field, batch, random))
        total, asked = total + len(found[-1]), asked + batch
        if total >= count:
            break
        batch = int(np.clip(1.05 * (count - total) * asked / max(total, 1), _FIRST_BATCH, _LARGEST_BATCH))
    if total == 0:
        raise checks.InputError("the field sees no surface that it confirms: fit it for longer")
    discs, back = flat_discs(np.concatenate(found)[:count], PLANE_HITS), field.field_from_mesh.inverse()
    return CheckedCloud(
        Discs(back.apply(discs.centres), back.apply_directions(discs.normals), back.scale * discs.radii)
    )


def _confirmed(field: framed_field.FramedField, count: int, random: np.random.Generator) -> Float[np.ndarray, "_ 3"]:
    """The hits of a batch of rays that the field confirms, field frame."""
    positions = random.uniform(field.lower, field.upper, (count, 3))
    directions = random.standard_normal((count, 3))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    visibility, depth = _ask(field, positions, directions)
    seen = visibility >= LEAST_VISIBILITY
    hits = rays.surface_points(positions, directions, depth)[seen]
    directions = directions[seen]
    unit = float((field.upper - field.lower).max()) / 2
    ahead = [np.zeros(len(hits))]
    for step in [sign * offset * unit for offset in OFFSETS for sign in (-1.0, 1.0)]:
        starts = hits + step * directions
        inside = ((starts >= field.lower) & (starts <= field.upper)).all(axis=-1)
        _, depth = _ask(field, starts[inside], -np.sign(step) * directions[inside])
        answer = np.zeros(len(hits))
        answer[inside] = step - np.sign(step) * depth
        ahead.append(answer)
    answers = np.stack(ahead)
    spread = np.abs(answers - np.median(answers, axis=0)).mean(axis=0)
    in_box = ((hits >= field.lower) & (hits <= field.upper)).all(axis=-1)
    return hits[in_box & (spread <= LARGEST_SPREAD * unit)]


def _ask(
    field: framed_field.FramedField, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]
) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
    """Visibility and depth inside the box, field frame, in chunks."""
    visibility, depth = np.zeros(len(positions)), np.zeros(len(positions))
    for start in range(0, len(positions), _CHUNK):
        chunk = slice(start, start + _CHUNK)
        found = field.evaluate(positions[chunk], directions[chunk], ("visibility", "depth"))
        visibility[chunk], depth[chunk] = found["visibility"], found["depth"]
    return visibility, depth
