"""Chairs, facing +X, in metres: `build` of eight bases, `build_wide` of more families and wider measures."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from ddf.data.synthetic import chair_parts, palette, parts
from ddf.data.synthetic.chair_parts import Frame
from ddf.data.synthetic.parts import Part, Real

BASES = ("legs", "crossed", "rocker", "sledge", "star", "disc", "cantilever", "block")
BASE_ODDS = (0.37, 0.05, 0.05, 0.09, 0.14, 0.08, 0.08, 0.14)
METAL_BASES = ("sledge", "star", "disc", "cantilever")
# Ends of width, depth, seat, thickness, back and lean of a `Frame`: usual chairs and bar stools; any, and low ones.
MEASURES = {
    "usual": ((0.38, 0.6), (0.37, 0.54), (0.36, 0.52), (0.02, 0.1), (0.28, 0.75), (0.02, 0.32)),
    "tall": ((0.38, 0.6), (0.37, 0.54), (0.62, 0.8), (0.02, 0.1), (0.16, 0.34), (0.02, 0.32)),
    "any": ((0.36, 0.66), (0.36, 0.6), (0.38, 0.55), (0.015, 0.12), (0.25, 0.85), (0.0, 0.35)),
    "low": ((0.48, 0.8), (0.48, 0.72), (0.24, 0.42), (0.03, 0.16), (0.35, 0.8), (0.25, 0.65)),
}
STRETCH = 0.08  # of wide ones: logarithm of the factors along the axes


def build(rng: np.random.Generator) -> list[Part]:
    """One chair."""
    base = str(rng.choice(BASES, p=BASE_ODDS))
    wood, cloth = palette.chair(rng, is_metal=base in METAL_BASES)
    tall = base in ("legs", "disc", "star") and rng.random() < 0.08  # a bar stool
    frame = _drawn(rng, "tall" if tall else "usual", wood, cloth)
    if base == "block":
        return _armchair(rng, frame)
    pieces = chair_parts.BASES[base](rng, frame)
    if base in ("legs", "star", "disc", "sledge") and rng.random() < 0.2:
        return [*pieces, *chair_parts.shell(rng, frame)]
    pieces += chair_parts.seat(rng, frame) + chair_parts.back(rng, frame)
    return pieces + (chair_parts.arms(rng, frame) if rng.random() < 0.42 else [])


def _armchair(rng: np.random.Generator, f: Frame) -> list[Part]:
    """A club chair: upholstered blocks on short feet."""
    width, depth = f.width * rng.uniform(1.35, 1.75), f.depth * rng.uniform(1.4, 1.7)
    seat, arm = rng.uniform(0.34, 0.44), rng.uniform(0.09, 0.17)
    foot = rng.uniform(0.03, 0.14)
    back, arm_height = rng.uniform(0.32, 0.55), rng.uniform(0.12, 0.26)
    thick = rng.uniform(0.12, 0.2)
    lean = rng.uniform(0.0, 0.2)
    frame = Frame(width, depth, seat, seat - foot, back, lean, f.wood, f.cloth)
    pieces = [
        parts.box((0, (foot + seat - 0.1) / 2, 0), (depth, seat - 0.1 - foot, width), f.cloth, name="body"),
        chair_parts.cushion(frame, (0.02, seat, 0), (depth - thick * 0.6, 0.15, width - 2 * arm + 0.01), 7.0),
    ]
    place, size = (-depth / 2 + thick / 2, (foot + seat + back) / 2, 0), (thick, seat + back - foot, width)
    rear = parts.box(place, size, f.cloth, name="back")
    pieces.append(rear.turned("z", lean, (-depth / 2, foot, 0)))
    if rng.random() < 0.6:
        roll = parts.lathe(parts.disc_profile(arm * 0.62, depth * 0.46, 0.02), f.cloth, sides=18, axis="x", name="roll")
        pieces += parts.both_sides([roll.moved(0.02, seat + arm_height - arm * 0.5, width / 2 - arm / 2)])
    place, size = (0.0, (foot + seat + arm_height) / 2, width / 2 - arm / 2), (depth, seat + arm_height - foot, arm)
    pieces += parts.both_sides([parts.box(place, size, f.cloth, name="arm")])
    if rng.random() < 0.25:
        place, size = (-depth / 2 + thick, seat + back * 0.62, width / 2 - arm * 0.4), (0.26, back * 0.72, arm * 0.7)
        wing = parts.box(place, size, f.cloth)
        pieces += parts.both_sides([wing.turned("z", lean, (-depth / 2, foot, 0))])
    if rng.random() < 0.7:
        pillow = chair_parts.cushion(frame, (0, 0, 0), (back * 0.95, thick * 0.7, width - 2 * arm), 6.0)
        pillow = pillow.turned("z", -np.pi / 2 + lean)
        pieces.append(pillow.moved(-depth / 2 + thick * 1.5 - lean * back / 2, seat + back / 2, 0))
    leg = parts.tube([(0, foot + 0.01, 0), (0, 0, 0)], [0.03, 0.018], f.wood, sides=8, name="foot")
    x, z = depth / 2 - 0.06, width / 2 - 0.06
    return pieces + [leg.moved(i * x, 0, j * z) for i in (-1, 1) for j in (-1, 1)]


def build_wide(rng: np.random.Generator) -> list[Part]:
    """One chair of any family, stretched."""
    family = FAMILIES[int(rng.choice(len(FAMILIES), p=[share for _, share in FAMILIES]))][0]
    factors = np.exp(rng.uniform(-STRETCH, STRETCH, 3))
    return [part.scaled(*factors) for part in family(rng)]


def _frame(rng: np.random.Generator, *, low: bool = False) -> Frame:
    """Measures of any chair, or of one to lean back in."""
    wood, cloth = palette.chair(rng, is_metal=rng.random() < 0.4)
    return _drawn(rng, "low" if low else "any", wood, cloth)


def _drawn(rng: np.random.Generator, kind: str, wood: palette.Paint, cloth: palette.Paint) -> Frame:
    return Frame(*(rng.uniform(*span) for span in MEASURES[kind]), wood=wood, cloth=cloth)


def _base(rng: np.random.Generator, f: Frame, *names: str) -> list[Part]:
    return chair_parts.BASES[str(rng.choice(names))](rng, f)


def common(rng: np.random.Generator) -> list[Part]:
    """What `build` makes, of wider measures."""
    f = _frame(rng)
    pieces = _base(rng, f, "legs", "legs", "legs", "legs", "crossed", "rocker", "sledge", "star", "disc", "cantilever")
    pieces += chair_parts.seat(rng, f) + chair_parts.back(rng, f)
    return pieces + (chair_parts.arms(rng, f) if rng.random() < 0.45 else [])


def stool(rng: np.random.Generator) -> list[Part]:
    """A seat without a back, low or as high as a bar, with or without a ring for the feet."""
    f = replace(_frame(rng), seat=rng.uniform(0.4, 0.85), width=rng.uniform(0.28, 0.5))
    f = replace(f, thickness=rng.uniform(0.02, 0.1))
    f = replace(f, depth=f.width * rng.uniform(0.8, 1.1))
    top = chair_parts.cushion(f, (0, f.seat, 0), (f.depth, f.thickness, f.width), rng.choice([2.0, 2.0, 8.0]))
    pieces = [top, *_base(rng, f, "legs", "legs", "legs", "disc", "star", "crossed")]
    if rng.random() < 0.35:
        angle = np.arange(20) * (2 * np.pi / 20)
        path = np.stack([np.cos(angle), np.full(20, rng.uniform(0.3, 0.5) * f.seat), np.sin(angle)], axis=1)
        path *= [f.depth / 2 - 0.01, 1, f.width / 2 - 0.01]
        pieces.append(parts.tube(path, 0.01, f.wood, sides=6, closed=True, name="ring"))
    if rng.random() < 0.3:
        pieces += chair_parts.back(rng, replace(f, back=rng.uniform(0.14, 0.3)))
    return pieces


def tub(rng: np.random.Generator) -> list[Part]:
    """A wall of one piece round the seat, from a thin shell to upholstery: tubs, eggs, wing chairs."""
    f = _frame(rng, low=rng.random() < 0.5)
    f = replace(f, width=rng.uniform(0.48, 0.85), depth=rng.uniform(0.48, 0.8), lean=f.lean * 0.7)
    grounded, thick = rng.random() < 0.4, float(np.exp(rng.uniform(np.log(0.015), np.log(0.14))))
    foot = rng.uniform(0.0, 0.08) if grounded else max(f.seat - rng.uniform(0.06, 0.2), 0.12)
    power, reach = rng.uniform(2.0, 5.0), np.radians(rng.uniform(80, 150))
    arm, sharp = f.back * rng.uniform(0.1, 0.75), rng.uniform(0.6, 3.0)
    shrink, flare = rng.uniform(0.55, 1.0), rng.uniform(-0.1, 0.25)
    angle = np.linspace(-reach, reach, 25)
    cos, sin = np.cos(angle), np.sin(angle)
    radius = (np.abs(cos) ** power + np.abs(sin) ** power) ** (-1 / power)
    across = np.stack([-f.depth / 2 * radius * cos, f.width / 2 * radius * sin], axis=1)
    rise = f.seat + arm + (f.back - arm) * np.cos(angle / reach * np.pi / 2) ** sharp
    sections = []
    for share, inset in ((0, 1.0), (0.4, 1.0), (0.8, 1.0), (1.0, 0.7), (1.0, 0.3), (0.8, 0.0), (0.4, 0.0), (0, 0.0)):
        height = foot + share * (rise - foot)
        above = np.clip((height - f.seat) / f.back, 0, 1)
        scale = np.where(height < f.seat, shrink + (1 - shrink) * (height - foot) / (f.seat - foot), 1 + flare * above)
        outer = across * (scale * (1 - inset * 2 * thick / f.width))[:, None]
        lean = np.tan(f.lean) * np.clip(height - f.seat, 0, None) * (0.5 + 0.5 * cos)
        sections.append(np.stack([outer[:, 0] - lean, height, outer[:, 1]], axis=1))
    wall = _outward(parts.loft(np.stack(sections, axis=1), f.cloth, name="shell"))
    inner = (f.depth - thick, f.seat - foot, f.width - thick)
    below = _bowl(f, foot, inner, shrink, power)
    pad = chair_parts.cushion(f, (0.02, f.seat + rng.uniform(0, 0.08), 0), (inner[0], 0.1, inner[2] - thick), power)
    pieces = [wall, below, pad]
    if grounded:
        return pieces + (_feet(f, foot) if foot > 0.02 else [])
    held = replace(f, seat=foot + 0.01, thickness=0.02, width=f.width * shrink, depth=f.depth * shrink)
    return pieces + _base(rng, held, "legs", "legs", "disc", "star", "sledge")


def _bowl(f: Frame, foot: Real, size: tuple[Real, Real, Real], shrink: Real, power: Real) -> Part:
    """The body under the seat, from the floor or the base to the cushion."""
    sections = []
    for share in (0.0, 0.5, 1.0):
        outline = parts.ring(28, size[0], size[2], power) * (shrink + (1 - shrink) * share)
        sections.append(np.insert(outline * [1, -1], 1, foot + share * size[1] * 0.95, axis=1))
    return _outward(parts.loft(np.stack(sections), f.cloth, name="body"))


def _outward(part: Part) -> Part:
    """A closed part, wound so that its volume is positive."""
    a, b, c = (part.vertices[part.triangles[:, k]] for k in range(3))
    return part if (a * np.cross(b, c)).sum() > 0 else replace(part, triangles=part.triangles[:, ::-1])


def _feet(f: Frame, height: Real) -> list[Part]:
    """Four short feet under a body."""
    leg = parts.tube([(0, height + 0.02, 0), (0, 0, 0)], [0.025, 0.018], f.wood, sides=8, name="foot")
    x, z = f.depth * 0.3, f.width * 0.3
    return [leg.moved(i * x, 0, j * z) for i in (-1, 1) for j in (-1, 1)]


def club(rng: np.random.Generator) -> list[Part]:
    """A low upholstered chair of soft blocks; some are wide, some have a wooden frame and loose pillows."""
    f = _frame(rng, low=True)
    width, depth = rng.uniform(0.65, 1.15), rng.uniform(0.65, 1.05)
    arm, thick, foot = rng.uniform(0.06, 0.28), rng.uniform(0.08, 0.3), rng.choice([0.02, rng.uniform(0.03, 0.16)])
    seat, back, rest = rng.uniform(0.34, 0.5), rng.uniform(0.2, 0.65), rng.uniform(0.05, 0.32)
    lean, power = rng.uniform(0.0, 0.3), rng.uniform(5.0, 12.0)
    f = replace(f, width=width, depth=depth, seat=seat, lean=lean)
    inner = width - 2 * arm
    pieces = [
        chair_parts.cushion(f, (0, seat - 0.08, 0), (depth * 0.98, seat - 0.08 - foot, width * 0.98), power),
        chair_parts.cushion(f, (0.03, seat + 0.03, 0), (depth - thick * 0.6, 0.16, inner + 0.01), power),
    ]
    rear = chair_parts.cushion(f, (0, 0, 0), (seat + back - foot, thick, width if rng.random() < 0.6 else inner), power)
    rear = rear.turned("z", -np.pi / 2).moved(thick - depth / 2, (foot + seat + back) / 2, 0)
    pieces.append(rear.turned("z", lean, (-depth / 2, foot, 0)))
    open_frame = rng.random() < 0.2
    size = (depth * rng.uniform(0.75, 1.0), 0.06 if open_frame else seat + rest - foot, 0.06 if open_frame else arm)
    side = chair_parts.cushion(replace(f, cloth=f.wood if open_frame else f.cloth), (0, seat + rest, 0), size, power)
    side = side.moved(depth / 2 - size[0] / 2, 0, width / 2 - size[2] / 2)
    posts = [parts.beam((x, seat - 0.1, width / 2 - 0.03), (x, seat + rest - 0.02, width / 2 - 0.03), 0.05, f.wood)
             for x in (depth / 2 - 0.06, depth / 2 - size[0] + 0.06)]  # fmt: skip
    pieces += parts.both_sides([side, *(posts if open_frame else [])])
    if rng.random() < 0.5:
        pillow = chair_parts.cushion(f, (0, 0, 0), (back * rng.uniform(0.8, 1.2), 0.16, inner), 5.0)
        pillow = pillow.turned("z", lean - np.pi / 2)
        pieces.append(pillow.moved(thick + 0.1 - depth / 2 - lean * back / 2, seat + back * 0.5, 0))
    return pieces + _feet(f, foot)


def lounge(rng: np.random.Generator) -> list[Part]:
    """To lean back in: low chairs with arms, long ones, and cloth in a folding frame."""
    f, kind = _frame(rng, low=True), rng.choice(["low", "long", "deck"], p=[0.5, 0.25, 0.25])
    if kind == "low":
        pieces = _base(rng, f, "legs", "star", "sledge", "cantilever", "disc")
        pieces += chair_parts.seat(rng, f) + chair_parts.back(rng, f)
        return pieces + (chair_parts.arms(rng, f) if rng.random() < 0.7 else [])
    half, high = f.width / 2, rng.uniform(0.6, 0.95)
    if kind == "long":
        knots = [(0.95, rng.uniform(0.28, 0.45)), (0.45, rng.uniform(0.35, 0.5)), (-0.05, 0.26), (-0.7, high)]
        line = parts.curve([(x, y, 0) for x, y in knots], 24)
        places = [(x, z) for x in (0.6, -0.05) for z in (half - 0.03, 0.03 - half)]
        paths = [[(x, 0.3, z), (x, 0.0, z), (x - 0.3, 0.0, z), (x - 0.3, 0.34, z)] for x, z in places]
        stands = [parts.tube(parts.rounded(path, 0.05), 0.012, f.wood) for path in paths]
        return [_sheet(f, line, rng.uniform(0.02, 0.14)), *stands]
    front, low = rng.uniform(0.4, 0.6), rng.uniform(0.18, 0.3)
    knots = [(front, 0.42, 0), (front * 0.5, 0.3, 0), (-0.1, low, 0), (-0.35, 0.45, 0), (-0.62, high, 0)]
    line = parts.curve(knots, 24)
    rails = [
        parts.beam((-0.64, high, half), (0.35, 0.0, half), 0.035, f.wood, name="rail"),
        parts.beam((front, 0.42, half - 0.04), (-0.55, 0.0, half - 0.04), 0.035, f.wood, name="rail"),
    ]
    ends = ((front, 0.42), (-0.64, high), (0.35, 0.02))
    bars = [parts.beam((x, y, -half), (x, y, half), 0.03, f.wood) for x, y in ends]
    return [_sheet(replace(f, width=f.width - 0.1), line, 0.012), *parts.both_sides(rails), *bars]


def _sheet(f: Frame, line: Float[np.ndarray, "k 3"], thickness: Real) -> Part:
    """A padded strip along a line of the middle plane, as wide as the frame."""
    along = np.gradient(line, axis=0)
    normal = np.stack([-along[:, 1], along[:, 0], np.zeros(len(line))], axis=1)
    normal *= thickness / 2 / np.linalg.norm(normal, axis=1, keepdims=True)
    out = np.array([0, 0, f.width / 2])
    corners = [line + normal - out, line + normal + out, line - normal + out, line - normal - out]
    return _outward(parts.loft(np.stack(corners, axis=1), f.cloth, name="sheet"))


def bent(rng: np.random.Generator) -> list[Part]:
    """Curved legs and a round back of bent wood or tube, empty, with an inner hoop, or with a panel."""
    f = replace(_frame(rng), back=rng.uniform(0.3, 0.62), lean=rng.uniform(0.05, 0.3))
    radius, half = rng.uniform(0.01, 0.024), f.width / 2 * rng.uniform(0.75, 1.0)
    power, waist = rng.uniform(1.6, 4.0), rng.uniform(0.6, 1.0)
    size = (f.depth, f.thickness + 0.01, f.width)
    pieces = [chair_parts.cushion(f, (0, f.seat, 0), size, rng.choice([2.0, 3.0, 6.0]))]
    pieces.append(_hoop(f, half, f.back, power, waist, radius))
    inside = rng.choice(["none", "hoop", "panel", "bars"])
    if inside == "hoop":
        pieces.append(_hoop(f, half * 0.55, f.back * 0.75, power, waist, radius * 0.7))
    if inside == "panel":
        outline = parts.ring(24, f.back * 0.6, half * 1.5, 2.2)
        height = f.back * 0.6 + outline[:, 0]
        columns = f.on_back(height), f.seat + f.back * 0.6 + outline[:, 0], outline[:, 1]
        rings = [np.stack([columns[0] + x, *columns[1:]], axis=1) for x in (-0.02, 0.02)]
        pieces.append(_outward(parts.loft(np.stack(rings), f.cloth, name="panel")))
    if inside == "bars":
        for z in np.linspace(-half * 0.6, half * 0.6, int(rng.integers(3, 7))):
            top = f.back * (1 - abs(z / half) ** power) ** (1 / power)
            ends = [(f.on_back(h), f.seat + h, z) for h in (-f.thickness / 2, top)]
            pieces.append(parts.tube(ends, radius * 0.5, f.wood, sides=6, name="bar"))
    bow, foot = rng.uniform(-0.05, 0.07), rng.uniform(0.0, 0.08)
    for x, z in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        top = np.array([x * (f.depth / 2 - 0.04), f.seat - f.thickness / 2, z * (f.width / 2 - 0.04)])
        knots = top + np.array([[0, 0, 0], [x * bow, -f.seat * 0.3, z * bow], [x * foot, -top[1], z * foot]])
        sizes = np.linspace(1.5, 0.8, 9) * radius
        pieces.append(parts.tube(parts.curve(knots, 9), sizes, f.wood, sides=8, name="leg"))
    return pieces + (chair_parts.arms(rng, f) if rng.random() < 0.35 else [])


def _hoop(f: Frame, half: Real, high: Real, power: Real, waist: Real, radius: Real) -> Part:
    """A bent bar on the plane of the back, from seat to seat."""
    turn = np.linspace(0, np.pi, 25)
    cos, sin = np.cos(turn), np.sin(turn)
    z = half * np.sign(cos) * np.abs(cos) ** (2 / power) * (waist + (1 - waist) * np.sqrt(sin))
    height = high * sin ** (2 / power)
    return parts.tube(np.stack([f.on_back(height), f.seat + height, z], axis=1), radius, f.wood, sides=8, name="hoop")


def with_tray(rng: np.random.Generator) -> list[Part]:
    """A chair with a board in front of the sitter, for meals or for writing."""
    f = replace(_frame(rng), seat=rng.choice([rng.uniform(0.4, 0.5), rng.uniform(0.5, 0.65)]))
    pieces = _base(rng, f, "legs", "sledge", "crossed") + chair_parts.seat(rng, f) + chair_parts.back(rng, f)
    level, wide = f.seat + rng.uniform(0.18, 0.28), f.width * rng.uniform(0.6, 1.05)
    place, size = (-f.rear + 0.02, level, f.width / 2 - wide / 2), (f.depth * 0.55, 0.025, wide)
    board, z = parts.box(place, size, f.wood, name="tray"), f.width / 2 - 0.02
    post = parts.beam((-f.rear - 0.05, f.seat - 0.02, z), (-f.rear, level, z), 0.03, f.wood)
    return [*pieces, board, post, *chair_parts.arms(rng, replace(f, back=0.3))]


# Builder and share of each family of the wide ones.
FAMILIES = (
    (build, 0.42), (common, 0.1), (tub, 0.13), (club, 0.1), (lounge, 0.07), (bent, 0.07), (stool, 0.08),
    (with_tray, 0.03),
)  # fmt: skip
