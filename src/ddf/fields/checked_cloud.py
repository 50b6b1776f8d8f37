"""Hits of random rays that a field confirms: a cloud for distances, drawn from whatever can be asked along rays.

From p ~ U[B] along v ~ U[S²] the field sees a surface at q = p + d v. It is asked again along the same ray from before
and from behind q, at `OFFSETS`: a hit stays where the answers agree on where it is. (Whether they also see it does not
count: on a fitted solid the inner side does not, and the hits are as good.)
"""

import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.fields import framed_field
from ddf.geometry import rays

COUNT = 20_000
LEAST_VISIBILITY = 0.9
OFFSETS = (0.05, 0.1)  # of half the longest side of the box, as are the others
LARGEST_SPREAD = 0.015  # mean distance of the answers from their median
_BATCH, _MOST_BATCHES = 32_768, 40


def draw(field: framed_field.FramedField, count: int = COUNT, seed: int = 0) -> Float[np.ndarray, "_ 3"]:
    """Confirmed hits, mesh frame; fewer than `count` where the field confirms few.

    Raises:
      InputError: the field confirms none.
    """
    random, found, total = np.random.default_rng(seed), [], 0
    for _ in range(_MOST_BATCHES):
        found.append(_confirmed(field, random))
        total += len(found[-1])
        if total >= count:
            break
    if total == 0:
        raise checks.InputError("the field sees no surface that it confirms: fit it for longer")
    return field.field_from_mesh.inverse().apply(np.concatenate(found)[:count])


def _confirmed(field: framed_field.FramedField, random: np.random.Generator) -> Float[np.ndarray, "_ 3"]:
    """The hits of one batch of rays that the field confirms, field frame."""
    positions = random.uniform(field.lower, field.upper, (_BATCH, 3))
    directions = random.standard_normal((_BATCH, 3))
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
    for start in range(0, len(positions), framed_field.CHUNK_RAYS):
        chunk = slice(start, start + framed_field.CHUNK_RAYS)
        found = field.evaluate(positions[chunk], directions[chunk], ("visibility", "depth"))
        visibility[chunk], depth[chunk] = found["visibility"], found["depth"]
    return visibility, depth
