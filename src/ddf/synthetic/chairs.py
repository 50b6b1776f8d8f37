"""Chairs: four-legged, sledge, pedestal, cantilever and upholstered ones, facing +X, in metres."""

from dataclasses import dataclass

import numpy as np

from ddf.synthetic import palette, parts
from ddf.synthetic.parts import Paint, Part, Point, Real

BASES = ("legs", "sledge", "star", "disc", "cantilever", "block")
BASE_ODDS = (0.46, 0.1, 0.14, 0.08, 0.08, 0.14)


@dataclass(frozen=True)
class _Frame:
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

    def on_back(self, height: Real | np.ndarray) -> Real | np.ndarray:
        """x of the back's middle plane at a height above the seat."""
        return self.rear + 0.02 - np.tan(self.lean) * height


def build(rng: np.random.Generator) -> list[Part]:
    """One chair."""
    base = str(rng.choice(BASES, p=BASE_ODDS))
    wood, cloth = palette.chair(rng, is_metal=base in ("star", "disc", "cantilever", "sledge"))
    frame = _Frame(
        width=rng.uniform(0.4, 0.58),
        depth=rng.uniform(0.38, 0.52),
        seat=rng.uniform(0.38, 0.52),
        thickness=rng.uniform(0.025, 0.09),
        back=rng.uniform(0.3, 0.68),
        lean=rng.uniform(0.02, 0.3),
        wood=wood,
        cloth=cloth,
    )
    if base == "block":
        return _armchair(rng, frame)
    builders = {"legs": _four_legs, "sledge": _sledge, "star": _star, "disc": _disc, "cantilever": _cantilever}
    pieces = builders[base](rng, frame)
    pieces += _seat(rng, frame)
    pieces += _back(rng, frame)
    if rng.random() < 0.42:
        pieces += _arms(rng, frame)
    return pieces


def _seat(rng: np.random.Generator, f: _Frame) -> list[Part]:
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
    return [_cushion(f, (0.0, f.seat, 0.0), (f.depth, f.thickness * 1.4, f.width), 2.2 if kind == "round" else 5.0)]


def _cushion(f: _Frame, top: Point, size: Point, power: Real) -> Part:
    """A level cushion with a rounded rim; `top` is the middle of its upper face."""
    levels = [(-1.0, 0.94), (-0.85, 1.0), (-0.3, 1.0), (-0.08, 0.95), (0.0, 0.8)]
    sections = []
    for level, scale in levels:
        outline = parts.ring(24, size[0] * scale, size[2] * scale, power)
        height = np.full(len(outline), top[1] + level * size[1])
        sections.append(np.stack([top[0] + outline[:, 0], height, top[2] - outline[:, 1]], axis=1))
    return parts.loft(np.stack(sections), f.cloth, name="cushion")


def _dished_seat(rng: np.random.Generator, f: _Frame) -> Part:
    """An open sheet, sunk in the middle."""
    x, z = np.meshgrid(np.linspace(f.rear, -f.rear, 10), np.linspace(f.width / 2, -f.width / 2, 12), indexing="ij")
    sink = rng.uniform(0.01, 0.035) * (1 - (x / f.rear) ** 4) * (1 - (2 * z / f.width) ** 2)
    roll = 0.05 * np.clip(x / -f.rear - 0.6, 0, 1) ** 2  # waterfall front edge
    return parts.grid(np.stack([x, f.seat - sink - roll, z], axis=-1), f.cloth, name="seat")


def _back_point(f: _Frame, height: Real, z: Real, curve: Real = 0.0) -> tuple[Real, Real, Real]:
    """A point of the back, bent backwards by `curve` in the middle."""
    return (f.on_back(height) - curve * (1 - (2 * z / f.width) ** 2), f.seat + height, z)


def _back_panel(
    f: _Frame, low: Real, high: Real, width: Real, thickness: Real, curve: Real, paint: Paint, crown: Real = 0.0
) -> Part:
    """A bent slab of the back between two heights; thickness 0 gives an open sheet."""
    z, t = np.meshgrid(np.linspace(width / 2, -width / 2, 9), np.linspace(0, 1, 6), indexing="ij")
    height = low + t * (high - low) + crown * t * (1 - (2 * z / width) ** 2)
    x = f.on_back(height) - curve * (1 - (2 * z / f.width) ** 2)
    front = np.stack([x, f.seat + height, z], axis=-1)
    if thickness <= 0:
        return parts.grid(front, paint, name="back")
    rear = front - np.array([thickness, 0.0, 0.0])
    loop = np.concatenate([front, rear[:, ::-1]], axis=1)
    return parts.loft(loop[::-1], paint, name="back")


def _back(rng: np.random.Generator, f: _Frame) -> list[Part]:
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


def _post(rng: np.random.Generator, f: _Frame, z: Real, size: Real) -> Part:
    """An upright of the back."""
    return parts.tube(
        [_back_point(f, -f.thickness, z), _back_point(f, f.back * 0.5, z), _back_point(f, f.back, z)],
        [size / 2, size / 2, size * 0.4],
        f.wood,
        profile=parts.SQUARE,
        name="post",
    )


def _four_legs(rng: np.random.Generator, f: _Frame) -> list[Part]:
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


def _stretchers(rng: np.random.Generator, f: _Frame, legs: list, size: Real) -> list[Part]:
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


def _apron(f: _Frame, top: Real, thick: Real) -> list[Part]:
    """Boards under the seat between the legs, as single sheets without thickness."""
    x, z, drop = f.depth / 2 - thick, f.width / 2 - thick, 0.06
    corners = [(-x, -z), (x, -z), (x, z), (-x, z)]
    boards = []
    for (xa, za), (xb, zb) in zip(corners, corners[1:] + corners[:1], strict=True):
        points = np.array([[[xa, top - drop, za], [xa, top, za]], [[xb, top - drop, zb], [xb, top, zb]]])
        boards.append(parts.grid(points, f.wood, name="apron"))
    return boards


def _sledge(rng: np.random.Generator, f: _Frame) -> list[Part]:
    """Two runners of bent tube."""
    radius = rng.uniform(0.009, 0.016)
    reach = rng.uniform(-0.02, 0.05)
    z = f.width / 2 - 0.03
    top = f.seat - f.thickness
    x0, x1 = f.rear + 0.02 - reach, -f.rear - 0.02 + reach
    path = _rounded(
        [(f.rear + 0.05, top, z), (x0, radius, z), (x1, radius, z), (-f.rear - 0.05, top, z)], 0.05, closed=True
    )
    runner = parts.tube(path, radius, f.wood, sides=8, closed=True, name="runner")
    bars = [
        parts.tube([(x, height, -z), (x, height, z)], radius, f.wood, sides=8, name="bar")
        for x, height in ((0.6 * x0, radius), (f.rear + 0.08, top - 0.01), (-f.rear - 0.08, top - 0.01))
    ]
    return [*parts.both_sides([runner]), *bars]


def _rounded(corners: list, radius: Real, *, closed: bool = False) -> np.ndarray:
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


def _column(rng: np.random.Generator, f: _Frame, foot: Real) -> list[Part]:
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


def _star(rng: np.random.Generator, f: _Frame) -> list[Part]:
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


def _disc(rng: np.random.Generator, f: _Frame) -> list[Part]:
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


def _cantilever(rng: np.random.Generator, f: _Frame) -> list[Part]:
    """One bent tube: floor, front uprights and seat rails, without rear legs."""
    radius = rng.uniform(0.01, 0.016)
    z = f.width / 2 - 0.02
    top = f.seat - f.thickness - radius
    front, rear = -f.rear + rng.uniform(-0.02, 0.04), f.rear - rng.uniform(-0.03, 0.03)
    corners = [(f.rear, top, z), (front, top, z), (front + rng.uniform(-0.03, 0.03), radius, z), (rear, radius, z)]
    side = _rounded(corners, 0.08)
    return [
        *parts.both_sides([parts.tube(side, radius, f.wood, sides=8, name="runner")]),
        parts.tube([(rear, radius, -z), (rear, radius, z)], radius, f.wood, sides=8, name="bar"),
        parts.tube([(f.rear + 0.05, top, -z), (f.rear + 0.05, top, z)], radius, f.wood, sides=8, name="bar"),
    ]


def _arms(rng: np.random.Generator, f: _Frame) -> list[Part]:
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
        return parts.both_sides([parts.tube(_rounded(corners, 0.07), radius, f.wood, sides=8, name="arm")])
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


def _armchair(rng: np.random.Generator, f: _Frame) -> list[Part]:
    """A club chair: upholstered blocks on short feet."""
    width, depth = f.width * rng.uniform(1.35, 1.75), f.depth * rng.uniform(1.4, 1.7)
    seat, arm = rng.uniform(0.34, 0.44), rng.uniform(0.09, 0.17)
    foot = rng.uniform(0.03, 0.14)
    back, arm_height = rng.uniform(0.32, 0.55), rng.uniform(0.12, 0.26)
    thick = rng.uniform(0.12, 0.2)
    lean = rng.uniform(0.0, 0.2)
    frame = _Frame(width, depth, seat, seat - foot, back, lean, f.wood, f.cloth)
    pieces = [
        parts.box((0, (foot + seat - 0.1) / 2, 0), (depth, seat - 0.1 - foot, width), f.cloth, name="body"),
        _cushion(frame, (0.02, seat, 0), (depth - thick * 0.6, 0.15, width - 2 * arm + 0.01), 7.0),
    ]
    rear = parts.box(
        (-depth / 2 + thick / 2, (foot + seat + back) / 2, 0), (thick, seat + back - foot, width), f.cloth, name="back"
    )
    pieces.append(rear.turned("z", lean, (-depth / 2, foot, 0)))
    if rng.random() < 0.6:
        roll = parts.lathe(parts.disc_profile(arm * 0.62, depth * 0.46, 0.02), f.cloth, sides=18, axis="x", name="roll")
        pieces += parts.both_sides([roll.moved(0.02, seat + arm_height - arm * 0.5, width / 2 - arm / 2)])
    side = parts.box(
        (0.0, (foot + seat + arm_height) / 2, width / 2 - arm / 2),
        (depth, seat + arm_height - foot, arm),
        f.cloth,
        name="arm",
    )
    pieces += parts.both_sides([side])
    if rng.random() < 0.7:
        pillow = _cushion(frame, (0, 0, 0), (back * 0.95, thick * 0.7, width - 2 * arm), 6.0)
        pieces.append(
            pillow.turned("z", -np.pi / 2 + lean).moved(-depth / 2 + thick * 1.5 - lean * back / 2, seat + back / 2, 0)
        )
    leg = parts.tube([(0, foot + 0.01, 0), (0, 0, 0)], [0.03, 0.018], f.wood, sides=8, name="foot")
    x, z = depth / 2 - 0.06, width / 2 - 0.06
    return pieces + [leg.moved(i * x, 0, j * z) for i in (-1, 1) for j in (-1, 1)]
