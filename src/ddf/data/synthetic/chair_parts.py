"""Seats, backs and arms of chairs, facing +X, in metres; every part agrees on the measures of one `Frame`."""

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
        pitch = f.depth / count
        slats = [
            parts.box(
                (f.rear + (k + 0.5) * pitch, middle, 0), (0.72 * pitch, f.thickness * 0.5, f.width), f.wood, name="slat"
            )
            for k in range(count)
        ]
        rails = [
            parts.beam((f.rear, middle, z), (-f.rear, middle, z), 0.03, f.wood, name="rail")
            for z in (-f.width / 2 + 0.03, f.width / 2 - 0.03)
        ]
        return slats + rails
    if kind == "dished":
        return [_dished_seat(rng, f)]
    return [cushion(f, (0.0, f.seat, 0.0), (f.depth, f.thickness * 1.4, f.width), 2.2 if kind == "round" else 5.0)]


def cushion(f: Frame, top: Point, size: Point, power: Real) -> Part:
    """A level cushion with a rounded rim; `top` is the middle of its upper face."""
    levels = [(-1.0, 0.94), (-0.85, 1.0), (-0.3, 1.0), (-0.08, 0.95), (0.0, 0.8)]
    sections = []
    for level, scale in levels:
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
    middle = [
        parts.tube(
            [_back_point(f, low, z, curve), _back_point(f, f.back - rail / 2, z, curve)],
            bar,
            f.wood,
            sides=6,
            name="bar",
        )
        for z in places
    ]
    return [*posts, top, bottom, *middle]


def _post(rng: np.random.Generator, f: Frame, z: Real, size: Real) -> Part:
    """An upright of the back."""
    return parts.tube(
        [_back_point(f, -f.thickness, z), _back_point(f, f.back * 0.5, z), _back_point(f, f.back, z)],
        [size / 2, size / 2, size * 0.4],
        f.wood,
        profile=parts.SQUARE,
        name="post",
    )


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
        points = np.array(
            [[[rear, f.seat - f.thickness, z], [rear, level, z]], [[front, f.seat - f.thickness, z], [front, level, z]]]
        )
        top = parts.box(((front + rear) / 2, level, z), (front - rear, 0.025, 0.05), f.wood, name="rest")
        return parts.both_sides([parts.grid(points, f.wood, name="panel"), top])
    if kind == "tube":
        radius = rng.uniform(0.01, 0.016)
        corners = [(rear, level, z), (front, level, z), (front + 0.01, f.seat - f.thickness / 2, z)]
        return parts.both_sides([parts.tube(parts.rounded(corners, 0.07), radius, f.wood, sides=8, name="arm")])
    wide = rng.uniform(0.03, 0.07)
    rest = parts.box(
        ((front + rear) / 2, level, z),
        (front - rear, 0.03, wide),
        f.wood if kind == "post" else palette.BLACK,
        name="rest",
    )
    foot = front - rng.uniform(0.02, 0.12) if kind == "post" else (front + rear) / 2
    post = parts.beam((foot, f.seat - f.thickness, z - 0.01), (foot, level, z), 0.028, f.wood, name="post")
    return parts.both_sides([rest, post])


def shell(rng: np.random.Generator, f: Frame) -> list[Part]:
    """Seat and back in one moulded sheet, curled up at the sides; sometimes with arms of the same sheet."""
    high = min(f.back, 0.5)
    line = parts.curve(
        [
            (-f.rear + 0.03, f.seat - 0.03, 0),
            (-f.rear - 0.06, f.seat, 0),
            (0.0, f.seat - 0.015, 0),
            (f.rear + 0.07, f.seat + 0.01, 0),
            (f.rear - 0.01, f.seat + 0.1, 0),
            (f.on_back(high * 0.6) - 0.03, f.seat + high * 0.6, 0),
            (f.on_back(high) - 0.04, f.seat + high, 0),
        ],
        22,
    )
    share = np.linspace(0, 1, len(line))[:, None]
    across = np.linspace(-1, 1, 15)
    curl = (
        rng.uniform(0.02, 0.05) + (rng.uniform(0.08, 0.16) if rng.random() < 0.45 else 0.0) * np.sin(np.pi * share) ** 2
    )
    narrow = 1 - rng.uniform(0.05, 0.3) * share**2 - 0.1 * (1 - share) ** 4
    tangent = np.gradient(line, axis=0)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1) / np.linalg.norm(tangent, axis=1, keepdims=True)
    normal *= -1.0  # the line runs backwards: up is on its right
    lift = curl * np.abs(across) ** 2.5
    x, y = (line[:, k : k + 1] + normal[:, k : k + 1] * lift for k in range(2))
    sheet = np.stack([x, y, narrow * across * f.width / 2], axis=-1)
    sheets = [parts.grid(sheet, f.cloth, name="shell")]
    if rng.random() < 0.4:
        pad = cushion(f, (0.0, f.seat + 0.015, 0.0), (f.depth * 0.75, 0.03, f.width * 0.75), 4.0)
        sheets.append(pad)
    return sheets
