"""What chairs stand on: legs, rockers, runners, stars, discs and cantilevers, up to the underside of the seat."""

import numpy as np

from ddf.data.synthetic import palette, parts
from ddf.data.synthetic.chair_parts import Frame
from ddf.data.synthetic.parts import Part, Real


def four_legs(rng: np.random.Generator, f: Frame) -> list[Part]:
    """Square or turned legs, straight, tapered or splayed, sometimes with stretchers and an apron."""
    thick = rng.uniform(0.022, 0.05)
    taper = rng.uniform(0.45, 1.0)
    splay = rng.choice([0.0, rng.uniform(0.02, 0.1)])
    is_round = rng.random() < 0.45
    top = f.seat - f.thickness * 0.6
    feet = []
    legs = []
    for x_sign in (-1, 1):
        for z_sign in (-1, 1):
            upper = np.array([x_sign * (f.depth / 2 - thick), top, z_sign * (f.width / 2 - thick)])
            foot = np.array([upper[0] + x_sign * splay, 0.0, upper[2] + z_sign * splay])
            feet.append((upper, foot))
            profile = None if is_round else parts.SQUARE
            legs.append(
                parts.tube([upper, foot], [thick / 2, thick / 2 * taper], f.wood, sides=10, profile=profile, name="leg")
            )
    if rng.random() < 0.45:
        legs += _stretchers(rng, f, feet, thick * 0.6)
    if rng.random() < 0.4 and f.thickness < 0.06:
        legs += _apron(f, top, thick)
    return legs


def _stretchers(rng: np.random.Generator, f: Frame, legs: list, size: Real) -> list[Part]:
    """Bars between the legs: along both sides, and across or all round."""
    share = rng.uniform(0.35, 0.75)
    points = [upper + share * (foot - upper) for upper, foot in legs]  # (-x -z), (-x +z), (+x -z), (+x +z)
    pairs = [(0, 2), (1, 3)]
    if rng.random() < 0.5:
        pairs += [(0, 1), (2, 3)]
        return [parts.beam(points[i], points[j], size, f.wood, name="stretcher") for i, j in pairs]
    bars = [parts.beam(points[i], points[j], size, f.wood, name="stretcher") for i, j in pairs]
    left, right = (points[0] + points[2]) / 2, (points[1] + points[3]) / 2
    return [*bars, parts.beam(left, right, size, f.wood, name="stretcher")]


def _apron(f: Frame, top: Real, thick: Real) -> list[Part]:
    """Boards under the seat between the legs, as single sheets without thickness."""
    x, z, drop = f.depth / 2 - thick, f.width / 2 - thick, 0.06
    corners = [(-x, -z), (x, -z), (x, z), (-x, z)]
    boards = []
    for (xa, za), (xb, zb) in zip(corners, corners[1:] + corners[:1], strict=True):
        points = np.array([[[xa, top - drop, za], [xa, top, za]], [[xb, top - drop, zb], [xb, top, zb]]])
        boards.append(parts.grid(points, f.wood, name="apron"))
    return boards


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
        (0, foot - 0.02),
        (radius * 1.35, foot - 0.02),
        (radius * 1.35, sleeve),
        (radius, sleeve),
        (radius, top),
        (0, top),
    ]
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
        arm = parts.tube(
            [(0.0, level + 0.035, 0), (reach, level, 0)], [0.028, 0.016], f.wood, profile=parts.SQUARE, name="arm"
        )
        pieces.append(arm.turned("y", angle))
        if castors:
            wheel = parts.lathe(parts.disc_profile(0.03, 0.022, 0.006), black, sides=12, axis="z", name="castor")
            pieces.append(wheel.turned("y", rng.uniform(0, np.pi)).moved(reach, 0.03, 0).turned("y", angle))
            pieces.append(
                parts.beam((reach, 0.03, 0), (reach, level + 0.01, 0), 0.016, black, name="stem").turned("y", angle)
            )
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
