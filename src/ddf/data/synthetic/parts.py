"""Mesh parts: boxes, swept tubes, lofted surfaces, lathes and sheets, each with a paint.

A part is one connected piece of a shape with consistent outward winding; shapes are lists of overlapping parts, in any
unit of length (`assemble` normalises). Nearly everything is a grid of points, its cells split into triangles. float64.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from ddf.data.synthetic.palette import Paint, Real

Point = Sequence[Real] | np.ndarray


@dataclass(frozen=True)
class Part:
    """Triangles of one paint; indices count from this part's own first vertex."""

    vertices: Float[np.ndarray, "n 3"]
    triangles: Int[np.ndarray, "m 3"]
    paint: Paint
    name: str = "part"

    def moved(self, x: Real = 0.0, y: Real = 0.0, z: Real = 0.0) -> "Part":
        """The part shifted by (x, y, z)."""
        return replace(self, vertices=self.vertices + np.array([x, y, z]))

    def turned(self, axis: str, angle_rad: Real, about: Point = (0.0, 0.0, 0.0)) -> "Part":
        """The part rotated about an axis (right-handed) through the point `about`."""
        centre = np.asarray(about, dtype=np.float64)
        return replace(self, vertices=(self.vertices - centre) @ rotation(axis, angle_rad).T + centre)

    def scaled(self, x: Real = 1.0, y: Real = 1.0, z: Real = 1.0) -> "Part":
        """The part stretched along the axes, factors > 0."""
        return replace(self, vertices=self.vertices * np.array([x, y, z]))

    def mirrored(self) -> "Part":
        """The part reflected in the plane z = 0, wound outwards again."""
        return replace(self, vertices=self.vertices * np.array([1.0, 1.0, -1.0]), triangles=self.triangles[:, ::-1])


def rotation(axis: str, angle_rad: Real) -> Float[np.ndarray, "3 3"]:
    """Right-handed rotation matrix about a coordinate axis."""
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = cos, -sin, sin, cos
    return matrix


def both_sides(items: Iterable[Part]) -> list[Part]:
    """The parts and their mirror images in z = 0."""
    items = list(items)
    return items + [part.mirrored() for part in items]


def grid(
    points: Float[np.ndarray, "a b 3"],
    paint: Paint,
    *,
    close_a: bool = False,
    close_b: bool = False,
    name: str = "part",
) -> Part:
    """A sheet through a grid of points; a closed direction joins its last row to its first.

    Seen from the side where a runs right and b runs up the triangles wind counter-clockwise.
    """
    rows, columns = points.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    if close_a:
        index = np.concatenate([index, index[:1]], axis=0)
    if close_b:
        index = np.concatenate([index, index[:, :1]], axis=1)
    p, q, r, s = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    triangles = np.stack([np.stack([p, q, r], axis=-1), np.stack([p, r, s], axis=-1)], axis=2).reshape(-1, 3)
    return Part(np.ascontiguousarray(points.reshape(-1, 3), dtype=np.float64), triangles, paint, name)


def join(items: Sequence[Part], name: str | None = None) -> Part:
    """Several parts of one paint as one part, unwelded."""
    offsets = np.cumsum([0] + [len(part.vertices) for part in items[:-1]])
    return Part(
        np.concatenate([part.vertices for part in items]),
        np.concatenate([part.triangles + offset for part, offset in zip(items, offsets, strict=True)]),
        items[0].paint,
        name or items[0].name,
    )


def fan(ring: Float[np.ndarray, "s 3"], paint: Paint) -> Part:
    """The disc inside a closed ring, around its mean point, facing the side where the ring runs counter-clockwise."""
    count = len(ring)
    nodes = np.arange(count)
    triangles = np.stack([np.full(count, count), nodes, (nodes + 1) % count], axis=1)
    return Part(np.concatenate([ring, ring.mean(axis=0, keepdims=True)]), triangles, paint)


def hexahedron(
    bottom: Float[np.ndarray, "4 3"], top: Float[np.ndarray, "4 3"], paint: Paint, name: str = "part"
) -> Part:
    """A box with any eight corners; both rings run counter-clockwise seen from above."""
    faces = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])
    triangles = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    return Part(np.concatenate([bottom, top]).astype(np.float64), triangles, paint, name)


def rectangle(x: tuple[Real, Real], z: tuple[Real, Real], y: Real) -> Float[np.ndarray, "4 3"]:
    """Corners of a level rectangle, counter-clockwise seen from above."""
    return np.array([[x[0], y, z[1]], [x[1], y, z[1]], [x[1], y, z[0]], [x[0], y, z[0]]])


def box(centre: Point, size: Point, paint: Paint, *, taper: tuple[Real, Real] = (1.0, 1.0), name: str = "part") -> Part:
    """An upright box; `taper` scales its top in x and z."""
    (cx, cy, cz), (hx, hy, hz) = centre, np.asarray(size, dtype=np.float64) / 2
    tx, tz = hx * taper[0], hz * taper[1]
    bottom = rectangle((cx - hx, cx + hx), (cz - hz, cz + hz), cy - hy)
    return hexahedron(bottom, rectangle((cx - tx, cx + tx), (cz - tz, cz + tz), cy + hy), paint, name)


def ring(sides: int, width: Real = 1.0, height: Real = 1.0, power: Real = 2.0) -> Float[np.ndarray, "sides 2"]:
    """A superellipse |x/a|^power + |y/b|^power = 1, counter-clockwise; power 2 an ellipse, large powers a rectangle."""
    angle = (np.arange(sides) + 0.5) * (2 * np.pi / sides)
    cos, sin = np.cos(angle), np.sin(angle)
    radius = (np.abs(cos) ** power + np.abs(sin) ** power) ** (-1.0 / power)
    return np.stack([width / 2 * radius * cos, height / 2 * radius * sin], axis=1)


def loft(sections: Float[np.ndarray, "k s 3"], paint: Paint, *, caps: bool = True, name: str = "part") -> Part:
    """A skin through closed sections that run counter-clockwise seen from the last section, with flat ends."""
    skin = grid(sections, paint, close_b=True, name=name)
    skin = replace(skin, triangles=skin.triangles[:, ::-1])
    return join([skin, fan(sections[0][::-1], paint), fan(sections[-1], paint)], name) if caps else join([skin], name)


def _frames(path: Float[np.ndarray, "k 3"]) -> tuple[Float[np.ndarray, "k 3"], Float[np.ndarray, "k 3"]]:
    """Two unit vectors across a path, carried along it with as little twist as possible."""
    tangents = np.gradient(path, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    start = np.eye(3)[np.argmin(np.abs(tangents[0]))]
    firsts = []
    for tangent in tangents:
        start = start - (start @ tangent) * tangent
        start = start / np.linalg.norm(start)
        firsts.append(start)
    first = np.stack(firsts)
    return first, np.cross(tangents, first)


def tube(
    path: Sequence[Point] | np.ndarray,
    radius: Real | Point,
    paint: Paint,
    *,
    sides: int = 8,
    closed: bool = False,
    profile: Float[np.ndarray, "s 2"] | None = None,
    name: str = "part",
) -> Part:
    """A tube along a path, mitred at corners; `radius` may change from point to point.

    Args:
      closed: join the end to the start.
      profile: a cross-section of unit radius in place of the regular polygon, counter-clockwise.
    """
    points = np.asarray(path, dtype=np.float64)
    radii = np.broadcast_to(np.asarray(radius, dtype=np.float64), len(points))
    outline = ring(sides, 2.0, 2.0) if profile is None else profile
    wrapped = np.concatenate([points[-1:], points, points[:1]]) if closed else points
    first, second = _frames(wrapped)
    if closed:
        first, second = first[1:-1], second[1:-1]
    sections = points[:, None] + radii[:, None, None] * (
        outline[None, :, :1] * first[:, None] + outline[None, :, 1:] * second[:, None]
    )
    if closed:
        skin = grid(sections, paint, close_a=True, close_b=True, name=name)
        return replace(skin, triangles=skin.triangles[:, ::-1])
    return loft(sections, paint, name=name)


SQUARE = np.array([[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]])


def beam(start: Point, end: Point, size: Real | tuple[Real, Real], paint: Paint, *, name: str = "part") -> Part:
    """A straight square bar; `size` is its width, at the start and at the end."""
    return tube([start, end], np.asarray(size, dtype=np.float64) / 2, paint, profile=SQUARE, name=name)


def lathe(
    profile: Sequence[Point] | np.ndarray, paint: Paint, *, sides: int = 16, axis: str = "y", name: str = "part"
) -> Part:
    """A surface of revolution: (radius, place along the axis), in order of the axis; ends with radius > 0 stay open."""
    outline = np.asarray(profile, dtype=np.float64)
    angle = np.arange(sides) * (2 * np.pi / sides)
    sections = np.zeros((len(outline), sides, 3))
    along, i, j = {"x": (0, 1, 2), "y": (1, 2, 0), "z": (2, 0, 1)}[axis]
    sections[..., along] = outline[:, 1:]
    sections[..., i] = outline[:, :1] * np.cos(angle)
    sections[..., j] = outline[:, :1] * np.sin(angle)
    return loft(sections, paint, caps=False, name=name)


def disc_profile(radius: Real, half: Real, bevel: Real = 0.0) -> list[tuple[float, float]]:
    """A closed lathe profile of a cylinder with bevelled edges, centred at 0."""
    lower = [(0.0, -half), (radius - bevel, -half), (radius, -half + bevel)]
    return [*lower, (radius, half - bevel), (radius - bevel, half), (0.0, half)]


def curve(knots: Sequence[Point] | np.ndarray, count: int) -> Float[np.ndarray, "count 3"]:
    """Points along a Catmull-Rom curve through the knots."""
    points = np.asarray(knots, dtype=np.float64)
    padded = np.concatenate([2 * points[:1] - points[1:2], points, 2 * points[-1:] - points[-2:-1]])
    position = np.linspace(0, len(points) - 1, count)
    cell = np.minimum(position.astype(int), len(points) - 2)
    t = (position - cell)[:, None]
    a, b, c, d = (padded[cell + k] for k in range(4))
    return 0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3)


def rounded(corners: Sequence[Point], radius: Real, *, closed: bool = False) -> np.ndarray:
    """A polyline with its corners cut round."""
    points = np.asarray(corners, dtype=np.float64)
    count = len(points)
    inner = range(count) if closed else range(1, count - 1)
    path = [] if closed else [points[0]]
    for i in inner:
        before, here, after = points[i - 1], points[i], points[(i + 1) % count]
        into, out = before - here, after - here
        cut = min(radius, 0.45 * np.linalg.norm(into), 0.45 * np.linalg.norm(out))
        start = here + into / np.linalg.norm(into) * cut
        end = here + out / np.linalg.norm(out) * cut
        for t in np.linspace(0, 1, 5):
            path.append((1 - t) ** 2 * start + 2 * t * (1 - t) * here + t**2 * end)
    if not closed:
        path.append(points[-1])
    return np.stack(path)
