"""Hits of random rays that a field is surest of: a cloud for distances, from whatever can be asked along rays.

From p ~ U[B] along v ~ U[S²] the field sees a surface at q = p + d v. It is asked again towards q: along the same ray
from before and from behind, and along another line. How far the answers are apart is the doubt of q. Of hits that are
near each other the surest stay, so that every part of the surface keeps some: where a field sees a surface badly, a
bound that is the same everywhere would leave a hole. (Whether the later answers see it does not count: on a fitted
solid the inner side does not, and the hits are as good.) Last, each hit becomes a small disc in the plane of the hits
around it: what is left of the field's noise makes nearest hits too near, the gaps between hits make them too far, and
both turn v*.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ddf.core import checks
from ddf.fields import framed_field
from ddf.geometry import neighbours, rays

COUNT = 40_000  # hits that are asked about
OFFSET = 0.05  # from a hit to where it is asked about; of half the longest side of the box, as is the next
LARGEST_DOUBT = 0.18  # range of the answers along a ray, and the deviation of that along another line
RIVALS = 32  # nearest hits that a hit is compared with
SURER_RIVALS = 0.3  # share of them from which on it goes
LARGEST_DISC = 1.5  # radius, in those of the median disc
LONELY = 1.75  # distance to the last of the plane's hits, in the median, from which on a hit is a stray
PLANE_HITS = 12  # that a plane is laid through
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
    index, dist_sq = neighbours.Tree(points).search(points, count)
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
    """The surest of `count` hits, mesh frame; on a fitted field about a quarter. InputError where it sees nothing, or
    is sure of none.
    """
    random, found, total, batch, asked = np.random.default_rng(seed), [], 0, _FIRST_BATCH, 0
    for _ in range(_MOST_BATCHES):
        found.append(_seen(field, batch, random))
        total, asked = total + len(found[-1][0]), asked + batch
        if total >= count:
            break
        batch = int(np.clip(1.05 * (count - total) * asked / max(total, 1), _FIRST_BATCH, _LARGEST_BATCH))
    hits, directions = (np.concatenate(part)[:count] for part in zip(*found, strict=True))
    hits = surest(hits, _doubts(field, hits, directions, random), LARGEST_DOUBT * _half_side(field))
    if len(hits) == 0:
        raise checks.InputError("the field sees no surface that it confirms: fit it for longer")
    discs, back = flat_discs(hits, PLANE_HITS), field.field_from_mesh.inverse()
    return CheckedCloud(
        Discs(back.apply(discs.centres), back.apply_directions(discs.normals), back.scale * discs.radii)
    )


def surest(hits: Float[np.ndarray, "n 3"], doubts: Float[np.ndarray, "n"], largest: float) -> Float[np.ndarray, "_ 3"]:
    """Hits that fewer than `SURER_RIVALS` of the `RIVALS` nearest are surer than, without those that lie alone.

    Args:
      doubts: >= 0. largest: doubt from which on a hit is left out whatever the others are.
    """
    kept = doubts <= largest
    hits, doubts = hits[kept], doubts[kept]
    if len(hits) <= RIVALS:
        return hits
    index, _ = neighbours.Tree(hits).search(hits, RIVALS + 1)
    hits = hits[(doubts[index] < doubts[:, None]).sum(axis=1) < SURER_RIVALS * RIVALS]
    if len(hits) <= PLANE_HITS:
        return hits
    _, dist_sq = neighbours.Tree(hits).search(hits, PLANE_HITS)
    reach = np.sqrt(dist_sq.max(axis=1))
    return hits[reach <= LONELY * np.median(reach)]


def _half_side(field: framed_field.FramedField) -> float:
    return float((field.upper - field.lower).max()) / 2


def _in_box(field: framed_field.FramedField, points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
    return np.asarray(((points >= field.lower) & (points <= field.upper)).all(axis=-1))


def _seen(
    field: framed_field.FramedField, count: int, random: np.random.Generator
) -> tuple[Float[np.ndarray, "_ 3"], Float[np.ndarray, "_ 3"]]:
    """Hits in the box of a batch of rays, and the directions of these; field frame."""
    positions = random.uniform(field.lower, field.upper, (count, 3))
    directions = _directions(count, random)
    visibility, depth = _ask(field, positions, directions)
    hits = rays.surface_points(positions, directions, depth)
    kept = (visibility >= framed_field.SEEN) & _in_box(field, hits)
    return hits[kept], directions[kept]


def _directions(count: int, random: np.random.Generator) -> Float[np.ndarray, "count 3"]:
    found = random.standard_normal((count, 3))
    return found / np.linalg.norm(found, axis=-1, keepdims=True)


def _doubts(
    field: framed_field.FramedField,
    hits: Float[np.ndarray, "n 3"],
    directions: Float[np.ndarray, "n 3"],
    random: np.random.Generator,
) -> Float[np.ndarray, "n"]:
    """Range of the answers along the ray, the hit among them, and |deviation| of that along another line from the hit.

    The other line is asked from both sides; the nearer answer counts, since one side may not see the surface.
    """
    along = np.stack([np.zeros(len(hits)), *_answers(field, hits, directions)])
    across = np.abs(_answers(field, hits, _directions(len(hits), random))).min(axis=0)
    return np.ptp(along, axis=0) + across


def _answers(
    field: framed_field.FramedField, hits: Float[np.ndarray, "n 3"], lines: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "2 n"]:
    """Where the field sees the surface along lines through hits, from the hit on, asked from before and from behind.

    0 where the start lies outside the box.
    """
    answers, offset = np.zeros((2, len(hits))), OFFSET * _half_side(field)
    for answer, way in zip(answers, (1.0, -1.0), strict=True):
        starts = hits - way * offset * lines
        inside = _in_box(field, starts)
        _, depth = _ask(field, starts[inside], way * lines[inside])
        answer[inside] = way * (depth - offset)
    return answers


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
