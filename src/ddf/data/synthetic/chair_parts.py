"""Bases, seats, backs and arms of chairs, facing +X, in metres, that agree on the measures of one `Frame`."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ddf.data.synthetic import palette, parts
from ddf.data.synthetic.parts import Paint, Part, Point, Real


@dataclass(frozen=True)
class Frame:
    """The measures that all parts of one chair agree on; lengths in metres.

    width, depth, thickness: of the seat; seat: height of its upper face; back: height of the back above the seat; lean:
    angle of the back from upright, radians; wood, cloth: paints.
    """

    width: Real
    depth: Real
    seat: Real
    thickness: Real
    back: Real
    lean: Real
    wood: Paint
    cloth: Paint

    @property
    def rear(self) -> Real:
        """x of the seat's rear edge."""
        return -self.depth / 2

    def on_back(self, height: Any) -> Any:
        """x of the back's middle plane at a height (or an array of them) above the seat."""
        return self.rear + 0.02 - np.tan(self.lean) * height


def four_legs(rng: np.random.Generator, f: Frame) -> list[Part]:
    """Square or turned legs, straight, tapered or splayed, sometimes with stretchers and an apron."""
    thick = rng.uniform(0.022, 0.05)
    taper = rng.uniform(0.45, 1.0)
    splay = rng.choice([0.0, rng.uniform(0.02, 0.1)])
    is_round = rng.random() < 0.45
    top, profile, ends, legs = f.seat - f.thickness * 0.6, None if is_round else parts.SQUARE, [], []
    for x, z in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        upper = np.array([x * (f.depth / 2 - thick), top, z * (f.width / 2 - thick)])
        foot = np.array([upper[0] + x * splay, 0.0, upper[2] + z * splay])
        ends.append((upper, foot))
        radii = [thick / 2, thick / 2 * taper]
        legs.append(parts.tube([upper, foot], radii, f.wood, sides=10, profile=profile, name="leg"))
    if rng.random() < 0.45:
        legs += _stretchers(rng, f, ends, thick * 0.6)
    if rng.random() < 0.4 and f.thickness < 0.06:
        legs += _apron(f, top, thick)
    return legs


def _stretchers(rng: np.random.Generator, f: Frame, legs: list, size: Real) -> list[Part]:
    """Bars between the legs: along both sides, and across or all round."""
    share = rng.uniform(0.35, 0.75)
    points = [upper + share * (foot - upper) for upper, foot in legs]  # (-x -z), (-x +z), (+x -z), (+x +z)
    middles = [(points[0] + points[2]) / 2, (points[1] + points[3]) / 2]
    across = [(points[0], points[1]), (points[2], points[3])] if rng.random() < 0.5 else [middles]
    pairs = [(points[0], points[2]), (points[1], points[3]), *across]
    return [parts.beam(start, end, size, f.wood, name="stretcher") for start, end in pairs]


def _apron(f: Frame, top: Real, thick: Real) -> list[Part]:
    """Boards under the seat between the legs, as single sheets without thickness."""
    x, z, drop = f.depth / 2 - thick, f.width / 2 - thick, 0.06
    corners = [(-x, -z), (x, -z), (x, z), (-x, z)]
    sides = zip(corners, corners[1:] + corners[:1], strict=True)
    sheets = [[[(x, y, z) for y in (top - drop, top)] for x, z in ends] for ends in sides]
    return [parts.grid(np.array(sheet), f.wood, name="apron") for sheet in sheets]


def sledge(rng: np.random.Generator, f: Frame) -> list[Part]:
    """Two runners of bent tube."""
    radius = rng.uniform(0.009, 0.016)
    reach = rng.uniform(-0.02, 0.05)
    z = f.width / 2 - 0.03
    top = f.seat - f.thickness
    x0, x1 = f.rear + 0.02 - reach, -f.rear - 0.02 + reach
    path = parts.rounded(
        [(f.rear + 0.05, top, z), (x0, radius, z), (x1, radius, z), (-f.rear - 0.05, top, z)], 0.05, closed=True
    )
    runner = parts.tube(path, radius, f.wood, sides=8, closed=True, name="runner")
    bars = [
        parts.tube([(x, height, -z), (x, height, z)], radius, f.wood, sides=8, name="bar")
        for x, height in ((0.6 * x0, radius), (f.rear + 0.08, top - 0.01), (-f.rear - 0.08, top - 0.01))
    ]
    return [*parts.both_sides([runner]), *bars]


def _column(rng: np.random.Generator, f: Frame, foot: Real) -> list[Part]:
    """The post of a pedestal and the plate under the seat."""
    top = f.seat - f.thickness
    radius = rng.uniform(0.022, 0.04)
    sleeve = foot + 0.55 * (top - foot)
    profile = [
        (0, foot - 0.02), (radius * 1.35, foot - 0.02), (radius * 1.35, sleeve),
        (radius, sleeve), (radius, top), (0, top),
    ]  # fmt: skip
    column = parts.lathe(profile, f.wood, sides=14, name="column")
    return [column, parts.box((0, top - 0.008, 0), (0.2, 0.025, 0.2), f.wood, name="plate")]


def star(rng: np.random.Generator, f: Frame) -> list[Part]:
    """An office base: four or five arms with castors or glides."""
    count = int(rng.choice([4, 5], p=[0.3, 0.7]))
    reach = rng.uniform(0.26, 0.34)
    castors = rng.random() < 0.7
    level = 0.065 if castors else 0.02
    start = rng.uniform(0, 2 * np.pi)
    black = palette.BLACK
    pieces = _column(rng, f, level)
    for k in range(count):
        angle = start + 2 * np.pi * k / count
        path, sizes = [(0.0, level + 0.035, 0), (reach, level, 0)], [0.028, 0.016]
        arm = parts.tube(path, sizes, f.wood, profile=parts.SQUARE, name="arm")
        pieces.append(arm.turned("y", angle))
        if castors:
            wheel = parts.lathe(parts.disc_profile(0.03, 0.022, 0.006), black, sides=12, axis="z", name="castor")
            pieces.append(wheel.turned("y", rng.uniform(0, np.pi)).moved(reach, 0.03, 0).turned("y", angle))
            stem = parts.beam((reach, 0.03, 0), (reach, level + 0.01, 0), 0.016, black, name="stem")
            pieces.append(stem.turned("y", angle))
    return pieces


def disc(rng: np.random.Generator, f: Frame) -> list[Part]:
    """A round foot, flat or flared like a trumpet."""
    reach = rng.uniform(0.2, 0.28)
    if rng.random() < 0.5:
        profile = [(0, 0), (reach, 0), (reach, 0.012), (reach * 0.9, 0.022), (0.05, 0.035), (0.0, 0.04)]
        return [parts.lathe(profile, f.wood, sides=28, name="foot"), *_column(rng, f, 0.03)]
    top = f.seat - f.thickness
    share = np.linspace(0, 1, 14)
    radius = 0.035 + (reach - 0.035) * (1 - share) ** 3.2 + 0.05 * np.clip(share - 0.8, 0, 1)
    profile = [(reach, 0.0), *zip(radius, 0.008 + share * (top - 0.008), strict=True)]
    return [parts.lathe(profile, f.wood, sides=28, name="trumpet")]  # open below, as a cast foot


def cantilever(rng: np.random.Generator, f: Frame) -> list[Part]:
    """One bent tube: floor, front uprights and seat rails, without rear legs."""
    radius = rng.uniform(0.01, 0.016)
    z = f.width / 2 - 0.02
    top = f.seat - f.thickness - radius
    front, rear = -f.rear + rng.uniform(-0.02, 0.04), f.rear - rng.uniform(-0.03, 0.03)
    corners = [(f.rear, top, z), (front, top, z), (front + rng.uniform(-0.03, 0.03), radius, z), (rear, radius, z)]
    side = parts.rounded(corners, 0.08)
    return [
        *parts.both_sides([parts.tube(side, radius, f.wood, sides=8, name="runner")]),
        parts.tube([(rear, radius, -z), (rear, radius, z)], radius, f.wood, sides=8, name="bar"),
        parts.tube([(f.rear + 0.05, top, -z), (f.rear + 0.05, top, z)], radius, f.wood, sides=8, name="bar"),
    ]


def crossed(rng: np.random.Generator, f: Frame) -> list[Part]:
    """A folding chair's crossed legs on either side, with bars across."""
    size = rng.uniform(0.018, 0.03)
    z = f.width / 2 - 0.02
    top = f.seat - f.thickness / 2
    reach = rng.uniform(-0.02, 0.06)
    front, rear = -f.rear - 0.02, f.rear + 0.02
    legs = [
        parts.beam((rear, top, z), (front + reach, 0.0, z), size, f.wood, name="leg"),
        parts.beam((front, top, z - size), (rear - reach, 0.0, z - size), size, f.wood, name="leg"),
    ]
    share = rng.uniform(0.75, 0.9)
    bars = [
        parts.beam((x, y, -z), (x, y, z), size * 0.8, f.wood, name="bar")
        for x, y in ((rear + share * (front + reach - rear), (1 - share) * top), (front * 0.9, top), (rear * 0.9, top))
    ]
    return [*parts.both_sides(legs), *bars]


def rocker(rng: np.random.Generator, f: Frame) -> list[Part]:
    """Four legs on two curved rockers."""
    legs = four_legs(rng, f)
    radius = rng.uniform(0.9, 1.5)
    half = rng.uniform(0.36, 0.48)
    z = f.width / 2 - 0.04
    angle = np.linspace(-half / radius, half / radius, 13)
    path = np.stack([radius * np.sin(angle), radius * (1 - np.cos(angle)) - 0.03, np.full(13, z)], axis=1)
    runner = parts.tube(path, rng.uniform(0.014, 0.022), f.wood, profile=parts.SQUARE, name="rocker")
    return [*legs, *parts.both_sides([runner])]


# What chairs stand on, up to the underside of the seat.
BASES = {
    "legs": four_legs,
    "crossed": crossed,
    "rocker": rocker,
    "sledge": sledge,
    "star": star,
    "disc": disc,
    "cantilever": cantilever,
}


def seat(rng: np.random.Generator, f: Frame) -> list[Part]:
    """A board, a rounded cushion, a dished shell or slats."""
    kind = rng.choice(["board", "cushion", "dished", "slats", "round"], p=[0.32, 0.32, 0.14, 0.1, 0.12])
    middle = f.seat - f.thickness / 2
    if kind == "board":
        flare = rng.uniform(0.85, 1.0)  # narrower at the rear
        half = f.width / 2
        ring = np.array([[f.rear, half * flare], [-f.rear, half], [-f.rear, -half], [f.rear, -half * flare]])
        bottom, top = (np.insert(ring, 1, y, axis=1) for y in (f.seat - f.thickness, f.seat))
        return [parts.hexahedron(bottom, top, f.cloth, "seat")]
    if kind == "slats":
        count = int(rng.integers(4, 8))
        pitch, z = f.depth / count, f.width / 2 - 0.03
        places, size = [f.rear + (k + 0.5) * pitch for k in range(count)], (0.72 * pitch, f.thickness * 0.5, f.width)
        slats = [parts.box((x, middle, 0), size, f.wood, name="slat") for x in places]
        ends = [((f.rear, middle, z), (-f.rear, middle, z)) for z in (-f.width / 2 + 0.03, z)]
        return slats + [parts.beam(start, end, 0.03, f.wood, name="rail") for start, end in ends]
    if kind == "dished":
        return [_dished_seat(rng, f)]
    return [cushion(f, (0.0, f.seat, 0.0), (f.depth, f.thickness * 1.4, f.width), 2.2 if kind == "round" else 5.0)]


def cushion(f: Frame, top: Point, size: Point, power: Real) -> Part:
    """A level cushion with a rounded rim; `top` is the middle of its upper face."""
    sections = []
    for level, scale in ((-1.0, 0.94), (-0.85, 1.0), (-0.3, 1.0), (-0.08, 0.95), (0.0, 0.8)):
        outline = parts.ring(32, size[0] * scale, size[2] * scale, power)
        height = np.full(len(outline), top[1] + level * size[1])
        sections.append(np.stack([top[0] + outline[:, 0], height, top[2] - outline[:, 1]], axis=1))
    return parts.loft(np.stack(sections), f.cloth, name="cushion")


def _dished_seat(rng: np.random.Generator, f: Frame) -> Part:
    """An open sheet, sunk in the middle."""
    x, z = np.meshgrid(np.linspace(f.rear, -f.rear, 12), np.linspace(f.width / 2, -f.width / 2, 14), indexing="ij")
    sink = min(rng.uniform(0.01, 0.035), 0.6 * f.thickness) * (1 - (x / f.rear) ** 4) * (1 - (2 * z / f.width) ** 2)
    roll = 0.05 * np.clip(x / -f.rear - 0.6, 0, 1) ** 2  # waterfall front edge
    return parts.grid(np.stack([x, f.seat - sink - roll, z], axis=-1), f.cloth, name="seat")


def _back_point(f: Frame, height: Real, z: Real, curve: Real = 0.0) -> tuple[Real, Real, Real]:
    """A point of the back, bent backwards by `curve` in the middle."""
    return (f.on_back(height) - curve * (1 - (2 * z / f.width) ** 2), f.seat + height, z)


def _back_panel(
    f: Frame, low: Real, high: Real, width: Real, thickness: Real, curve: Real, paint: Paint, crown: Real = 0.0
) -> Part:
    """A bent slab of the back between two heights; thickness 0 gives an open sheet."""
    z, t = np.meshgrid(np.linspace(width / 2, -width / 2, 13), np.linspace(0, 1, 7), indexing="ij")
    height = low + t * (high - low) + crown * t * (1 - (2 * z / width) ** 2)
    x = f.on_back(height) - curve * (1 - (2 * z / f.width) ** 2)
    front = np.stack([x, f.seat + height, z], axis=-1)
    if thickness <= 0:
        return parts.grid(front, paint, name="back")
    rear = front - np.array([thickness, 0.0, 0.0])
    loop = np.concatenate([front, rear[:, ::-1]], axis=1)
    return parts.loft(loop[::-1], paint, name="back")


def back(rng: np.random.Generator, f: Frame) -> list[Part]:
    """Solid, sheet, ladder (level slats), spindles or bars within a frame, or a split panel."""
    kind = rng.choice(["solid", "sheet", "ladder", "bars", "frame", "panel"], p=[0.24, 0.12, 0.2, 0.18, 0.12, 0.14])
    curve = rng.uniform(0.0, 0.05)
    gap = rng.uniform(0.0, 0.14)
    thick = rng.uniform(0.015, 0.06)
    width = f.width * rng.uniform(0.82, 1.0)
    if kind == "solid":
        return [_back_panel(f, -0.02, f.back, width, thick, curve, f.cloth, rng.uniform(0, 0.06))]
    if kind == "sheet":
        return [_back_panel(f, -0.01, f.back, width, 0.0, curve * 1.6, f.cloth, rng.uniform(0, 0.08))]
    post = rng.uniform(0.022, 0.04)
    posts = [_post(rng, f, side * (width / 2 - post / 2), post) for side in (-1, 1)]
    if kind == "panel":
        low = gap + 0.05
        return [*posts, _back_panel(f, low, f.back, width, thick, curve, f.cloth, rng.uniform(0, 0.05))]
    rail = rng.uniform(0.04, 0.11)
    top = _back_panel(f, f.back - rail, f.back, width, thick * 0.6, curve, f.wood, rng.uniform(0, 0.05))
    if kind == "ladder":
        count = int(rng.integers(2, 6))
        steps = np.linspace(gap + 0.06, f.back - rail - 0.04, count)
        slat = min(0.07, 0.55 * f.back / count)
        return [*posts, top, *(_back_panel(f, h - slat / 2, h + slat / 2, width, 0.015, curve, f.wood) for h in steps)]
    low = gap + 0.03
    bottom = _back_panel(f, low, low + 0.04, width, thick * 0.6, curve, f.wood)
    if kind == "frame":
        inset = _back_panel(f, low + 0.04, f.back - rail, width * rng.uniform(0.25, 0.8), 0.012, curve, f.cloth)
        return [*posts, top, bottom, inset]
    count = int(rng.integers(3, 9))
    bar = rng.uniform(0.006, 0.012)
    places = np.linspace(-width / 2, width / 2, count + 2)[1:-1]
    heights = (low, f.back - rail / 2)
    paths = [[_back_point(f, height, z, curve) for height in heights] for z in places]
    return [*posts, top, bottom, *(parts.tube(path, bar, f.wood, sides=6, name="bar") for path in paths)]


def _post(rng: np.random.Generator, f: Frame, z: Real, size: Real) -> Part:
    """An upright of the back."""
    path = [_back_point(f, height, z) for height in (-f.thickness, f.back * 0.5, f.back)]
    return parts.tube(path, [size / 2, size / 2, size * 0.4], f.wood, profile=parts.SQUARE, name="post")


def arms(rng: np.random.Generator, f: Frame) -> list[Part]:
    """Arm rests on posts, bent tubes, or panels down to the seat."""
    height = rng.uniform(0.17, 0.26)
    height = min(height, f.back * 0.8)
    z = f.width / 2 + rng.uniform(-0.01, 0.03)
    front = -f.rear * rng.uniform(0.55, 1.0)
    rear = f.on_back(height)
    kind = rng.choice(["post", "tube", "panel", "pad"], p=[0.35, 0.25, 0.15, 0.25])
    level = f.seat + height
    if kind == "panel":
        points = np.array([[[x, y, z] for y in (f.seat - f.thickness, level)] for x in (rear, front)])
        top = parts.box(((front + rear) / 2, level, z), (front - rear, 0.025, 0.05), f.wood, name="rest")
        return parts.both_sides([parts.grid(points, f.wood, name="panel"), top])
    if kind == "tube":
        radius = rng.uniform(0.01, 0.016)
        corners = [(rear, level, z), (front, level, z), (front + 0.01, f.seat - f.thickness / 2, z)]
        return parts.both_sides([parts.tube(parts.rounded(corners, 0.07), radius, f.wood, sides=8, name="arm")])
    wide = rng.uniform(0.03, 0.07)
    paint = f.wood if kind == "post" else palette.BLACK
    rest = parts.box(((front + rear) / 2, level, z), (front - rear, 0.03, wide), paint, name="rest")
    foot = front - rng.uniform(0.02, 0.12) if kind == "post" else (front + rear) / 2
    post = parts.beam((foot, f.seat - f.thickness, z - 0.01), (foot, level, z), 0.028, f.wood, name="post")
    return parts.both_sides([rest, post])


def shell(rng: np.random.Generator, f: Frame) -> list[Part]:
    """Seat and back in one moulded sheet, curled up at the sides; sometimes with arms of the same sheet."""
    high = min(f.back, 0.5)
    knots = [
        (-f.rear + 0.03, f.seat - 0.03, 0), (-f.rear - 0.06, f.seat, 0), (0.0, f.seat - 0.015, 0),
        (f.rear + 0.07, f.seat + 0.01, 0), (f.rear - 0.01, f.seat + 0.1, 0),
        (f.on_back(high * 0.6) - 0.03, f.seat + high * 0.6, 0), (f.on_back(high) - 0.04, f.seat + high, 0),
    ]  # fmt: skip
    line = parts.curve(knots, 22)
    share = np.linspace(0, 1, len(line))[:, None]
    across = np.linspace(-1, 1, 15)
    least, more = rng.uniform(0.02, 0.05), rng.uniform(0.08, 0.16) if rng.random() < 0.45 else 0.0
    curl = least + more * np.sin(np.pi * share) ** 2
    narrow = 1 - rng.uniform(0.05, 0.3) * share**2 - 0.1 * (1 - share) ** 4
    tangent = np.gradient(line, axis=0)
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)  # the line runs backwards: up is on its right
    normal /= np.linalg.norm(tangent, axis=1, keepdims=True)
    lift = curl * np.abs(across) ** 2.5
    x, y = (line[:, k : k + 1] + normal[:, k : k + 1] * lift for k in range(2))
    sheet = np.stack([x, y, narrow * across * f.width / 2], axis=-1)
    sheets = [parts.grid(sheet, f.cloth, name="shell")]
    if rng.random() < 0.4:
        sheets.append(cushion(f, (0.0, f.seat + 0.015, 0.0), (f.depth * 0.75, 0.03, f.width * 0.75), 4.0))
    return sheets
