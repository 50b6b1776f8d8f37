"""Aeroplanes: airliners, business jets, propeller planes, fighters; nose to +X, wings along Z, in fuselage lengths."""

import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ddf.synthetic import palette, parts
from ddf.synthetic.parts import Paint, Part, Real

STYLES = ("airliner", "business", "propeller", "twin", "fighter", "delta")
STYLE_ODDS = (0.36, 0.13, 0.16, 0.1, 0.15, 0.1)


@dataclass(frozen=True)
class _Wing:
    """A lifting surface seen from above; lengths in fuselage lengths.

    x: leading edge at the root; root, tip: chords; span: from the centre line to the tip; sweep: how far back the tip's
    leading edge lies; rise: of the tip over the root; thickness: over the chord.
    """

    x: Real
    y: Real
    root: Real
    tip: Real
    span: Real
    sweep: Real
    rise: Real
    thickness: Real

    def leading(self, share: Real) -> np.ndarray:
        """The leading edge at a share of the span."""
        return np.array([self.x - share * self.sweep, self.y + share * self.rise, share * self.span])

    def chord(self, share: Real) -> Real:
        """The chord there."""
        return self.root + share * (self.tip - self.root)


def build(rng: np.random.Generator) -> list[Part]:
    """One aeroplane."""
    style = str(rng.choice(STYLES, p=STYLE_ODDS))
    body, accent = palette.plane(rng)
    builders = {
        "airliner": _airliner,
        "business": _business,
        "propeller": _propeller_plane,
        "twin": _twin,
        "fighter": _fighter,
        "delta": _fighter,
    }
    return builders[style](rng, body, accent, style)


def _airfoil(count: int = 6) -> Float[np.ndarray, "s 2"]:
    """A symmetric section of unit chord and thickness, from the trailing edge over the top and back: (behind, up)."""
    t = (1 - np.cos(np.linspace(0, np.pi, count))) / 2
    half = 5 * 0.2 * (1.4845 * np.sqrt(t) - 0.63 * t - 1.758 * t**2 + 1.4215 * t**3 - 0.518 * t**4)
    upper = np.stack([t[::-1], half[::-1]], axis=1)
    lower = np.stack([t[1:-1], -half[1:-1]], axis=1)
    return np.concatenate([upper, lower])


def _wing(wing: _Wing, paint: Paint, *, stations: int = 5, sheet: bool = False, name: str = "wing") -> Part:
    """The wing on the side of +Z, as a closed section or as an open sheet without thickness."""
    outline = _airfoil()
    sections = []
    for share in np.linspace(0.0, 1.0, stations):
        chord, start = wing.chord(share), wing.leading(share)
        up = outline[:, 1] * wing.thickness * chord
        sections.append(np.stack([start[0] - outline[:, 0] * chord, start[1] + up, np.full(len(up), start[2])], axis=1))
    points = np.stack(sections)
    if sheet:
        return parts.grid(points[:, : len(outline) // 2 + 1], paint, name=name)
    return parts.loft(points, paint, name=name)


def _fin(wing: _Wing, paint: Paint, name: str = "fin") -> Part:
    """A wing turned upright about the X axis: its span points up."""
    flat = _wing(wing, paint, stations=3, name=name)
    return flat.turned("x", -np.pi / 2)


def _fuselage(
    stations: list[tuple[Real, Real, Real, Real]],
    paint: Paint,
    *,
    sides: int = 18,
    power: Real = 2.0,
    count: int = 24,
) -> Part:
    """A body through (x, centre height, width, height) stations from tail to nose."""
    smooth = parts.curve([(x, y, w) for x, y, w, _ in stations], count)
    heights = parts.curve([(x, h, 0) for x, _, _, h in stations], count)[:, 1]
    sections = []
    for (x, y, width), height in zip(smooth, heights, strict=True):
        outline = parts.ring(sides, max(width, 0.002), max(height, 0.002), power)
        sections.append(np.stack([np.full(sides, x), y + outline[:, 1], -outline[:, 0]], axis=1))
    return parts.loft(np.stack(sections), paint, name="fuselage")


def _tube_body(rng: np.random.Generator, paint: Paint, width: Real) -> tuple[Part, Real]:
    """A transport's fuselage: round, with a drooping nose and a raised tail."""
    height = width * rng.uniform(1.0, 1.12)
    nose = rng.uniform(0.06, 0.1)
    lift = rng.uniform(0.2, 0.42) * height
    stations = [
        (-0.5, lift, width * 0.08, height * 0.12),
        (-0.4, lift * 0.8, width * 0.42, height * 0.46),
        (-0.26, lift * 0.25, width * 0.88, height * 0.9),
        (-0.15, 0, width, height),
        (0.1, 0, width, height),
        (0.5 - nose * 1.6, 0, width, height),
        (0.5 - nose * 0.7, -0.04 * height, width * 0.84, height * 0.84),
        (0.5 - nose * 0.15, -0.12 * height, width * 0.42, height * 0.42),
        (0.5, -0.14 * height, width * 0.06, height * 0.06),
    ]
    return _fuselage(stations, paint), height


def _windows(rng: np.random.Generator, width: Real, height: Real, front: Real, rear: Real) -> list[Part]:
    """A dark band of cabin windows on each side and a cockpit screen, as sheets just outside the skin."""
    count = int(rng.integers(8, 20))
    low, high = 0.06 * height, 0.16 * height
    spaced = np.linspace(rear, front, count + 1)
    panes = []
    for start, end in itertools.pairwise(spaced):
        edges = []
        for x in (start, start + 0.55 * (end - start)):
            edges.append([[x, y, 1.004 * width / 2 * np.sqrt(1 - (2 * y / height) ** 2) + 0.0006] for y in (low, high)])
        panes.append(parts.grid(np.array(edges), palette.GLASS, name="window"))
    return parts.both_sides([parts.join(panes)])


def _nacelle(radius: Real, length: Real, paint: Paint) -> list[Part]:
    """A jet engine, inlet at x = 0 and nozzle behind it, open at both ends, with a dark fan inside."""
    profile = [
        (0.55, -1.0), (0.78, -0.72), (0.98, -0.35), (1.0, -0.15),
        (0.95, -0.02), (0.86, 0.0), (0.8, -0.06), (0.78, -0.25),
    ]  # fmt: skip
    cowl = parts.lathe([(radius * r, length * x) for r, x in profile], paint, sides=16, axis="x", name="nacelle")
    fan = parts.lathe(
        [(radius * 0.8, -0.22 * length), (0.0, -0.1 * length)], palette.BLACK, sides=16, axis="x", name="fan"
    )
    cone = parts.lathe(
        [(0.0, -1.25 * length), (radius * 0.5, -0.9 * length), (radius * 0.55, -0.8 * length)],
        palette.CHROME,
        sides=12,
        axis="x",
        name="cone",
    )
    return [cowl, fan, cone]


def _pod(wing: _Wing, share: Real, radius: Real, length: Real, drop: Real, paint: Paint) -> list[Part]:
    """An engine under the wing at a share of the span, with its pylon."""
    edge = wing.leading(share)
    x, y = edge[0] + 0.55 * length, edge[1] - drop
    pods = [part.moved(x, y, edge[2]) for part in _nacelle(radius, length, paint)]
    top = edge[1] - 0.002
    pylon = parts.hexahedron(
        parts.rectangle((x - 0.9 * length, x - 0.15 * length), (edge[2] - 0.003, edge[2] + 0.003), y + radius * 0.85),
        parts.rectangle((edge[0] - 0.6 * wing.chord(share), edge[0] + 0.0), (edge[2] - 0.003, edge[2] + 0.003), top),
        paint,
        "pylon",
    )
    return [*pods, pylon]


def _tail(
    rng: np.random.Generator, paint: Paint, accent: Paint, top: Real, *, t_tail: bool, size: Real = 1.0
) -> list[Part]:
    """Fin and tail plane; on a T-tail the plane sits on top of the fin."""
    height = rng.uniform(0.14, 0.19) * size
    sweep = rng.uniform(0.07, 0.14) * size
    root = rng.uniform(0.13, 0.18) * size
    fin = _Wing(-0.5 + root + 0.03, 0.0, root, root * rng.uniform(0.35, 0.6), height, sweep, 0.0, 0.1)
    pieces = [_fin(fin, accent).moved(0, top, 0)]
    span = rng.uniform(0.13, 0.19) * size
    chord = rng.uniform(0.07, 0.1) * size
    x, y = -0.5 + chord + 0.03, top * 0.6
    if t_tail:
        x, y = fin.leading(0.95)[0] + 0.01, top + 0.96 * height
    plane = _Wing(
        x,
        y,
        chord,
        chord * rng.uniform(0.35, 0.7),
        span,
        rng.uniform(0.02, 0.08),
        0.0 if t_tail else rng.uniform(0, 0.03),
        0.09,
    )
    return pieces + parts.both_sides([_wing(plane, paint, stations=3, name="tailplane")])


def _airliner(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """Swept low wing, two or four engines under it (or two at the tail)."""
    width = rng.uniform(0.085, 0.125)
    fuselage, height = _tube_body(rng, body, width)
    root = rng.uniform(0.17, 0.24)
    wing = _Wing(
        x=rng.uniform(0.1, 0.17),
        y=-0.3 * height,
        root=root,
        tip=root * rng.uniform(0.2, 0.4),
        span=rng.uniform(0.38, 0.54),
        sweep=rng.uniform(0.14, 0.27),
        rise=rng.uniform(0.0, 0.06),
        thickness=0.11,
    )
    at_tail = rng.random() < 0.2
    pieces = [fuselage, *parts.both_sides([_wing(wing, body, sheet=rng.random() < 0.15)])]
    pieces += _windows(rng, width, height, 0.36, -0.2) if rng.random() < 0.7 else []
    pieces += _cockpit(width, height, 0.5)
    engine = rng.uniform(0.026, 0.037)
    length = engine * rng.uniform(3.2, 4.4)
    if at_tail:
        pieces += parts.both_sides(_tail_engines(body, width, height, engine * 0.85, length))
    else:
        shares = [0.33] if rng.random() < 0.68 else [0.27, 0.52]
        for share in shares:
            scale = 1.0 if len(shares) == 1 else 0.8
            pieces += parts.both_sides(
                _pod(
                    wing,
                    share,
                    engine * scale,
                    length * scale,
                    engine * scale * 1.25,
                    accent if rng.random() < 0.3 else body,
                )
            )
    if rng.random() < 0.45:
        pieces += parts.both_sides([_winglet(wing, accent)])
    return pieces + _tail(rng, body, accent, 0.32 * height, t_tail=at_tail)


def _cockpit(width: Real, height: Real, nose: Real) -> list[Part]:
    """The pilots' windows: a bent dark sheet over the nose."""
    angle, x = np.meshgrid(np.linspace(-1.0, 1.0, 9), np.array([nose - 0.05, nose - 0.032]), indexing="ij")
    scale = np.where(x < nose - 0.04, 0.475, 0.40)
    points = np.stack([x, height * (scale * np.cos(angle) * 0.92 - 0.05), width * scale * np.sin(angle)], axis=-1)
    return [parts.grid(points, palette.GLASS, name="screen")]


def _winglet(wing: _Wing, paint: Paint) -> Part:
    """A small upturned blade at the wing tip."""
    tip = wing.leading(1.0)
    blade = _Wing(0.0, 0.0, wing.tip, wing.tip * 0.4, 0.05, 0.05, 0.0, 0.1)
    return _fin(blade, paint, "winglet").turned("x", 0.25).moved(tip[0], tip[1], tip[2] - 0.002)


def _tail_engines(paint: Paint, width: Real, height: Real, radius: Real, length: Real) -> list[Part]:
    """One engine on a stub at the rear fuselage, side of +Z."""
    x, y, z = -0.2, 0.18 * height, width / 2 + radius * 1.15
    stub = parts.box((x - 0.5 * length, y, z - radius), (0.6 * length, 0.012, radius * 2), paint, name="stub")
    return [*(part.moved(x, y, z) for part in _nacelle(radius, length, paint)), stub]


def _business(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """Engines at the tail, T-tail, wing further back."""
    width = rng.uniform(0.11, 0.15)
    fuselage, height = _tube_body(rng, body, width)
    root = rng.uniform(0.2, 0.26)
    wing = _Wing(
        rng.uniform(0.04, 0.1),
        -0.38 * height,
        root,
        root * rng.uniform(0.25, 0.45),
        rng.uniform(0.38, 0.5),
        rng.uniform(0.08, 0.22),
        rng.uniform(0.01, 0.05),
        0.1,
    )
    radius = rng.uniform(0.03, 0.04)
    pieces = [fuselage, *parts.both_sides([_wing(wing, body)]), *_cockpit(width, height, 0.5)]
    pieces += _windows(rng, width, height, 0.28, -0.08)
    pieces += parts.both_sides(_tail_engines(accent, width * 0.8, height, radius, radius * 4.2))
    if rng.random() < 0.6:
        pieces += parts.both_sides([_winglet(wing, accent)])
    return pieces + _tail(rng, body, accent, 0.36 * height, t_tail=rng.random() < 0.85, size=1.1)


def _propeller(rng: np.random.Generator, radius: Real, x: Real) -> list[Part]:
    """Blades and a spinner, facing +X at x."""
    count = int(rng.choice([2, 3, 4]))
    start = rng.uniform(0, np.pi)
    blade = parts.hexahedron(
        np.array([[-0.004, 0, 0.008], [0.004, 0, 0.008], [0.004, 0, -0.008], [-0.004, 0, -0.008]]),
        np.array([[-0.001, radius, 0.012], [0.003, radius, 0.012], [0.001, radius, -0.012], [-0.003, radius, -0.012]]),
        palette.BLACK,
        "blade",
    )
    spinner = parts.lathe(
        [(0.022, -0.02), (0.019, 0.01), (0.01, 0.03), (0.0, 0.038)], palette.CHROME, sides=12, axis="x", name="spinner"
    )
    blades = [blade.turned("x", start + 2 * np.pi * k / count) for k in range(count)]
    return [part.moved(x) for part in [*blades, spinner]]


def _wheel(x: Real, y: Real, z: Real, radius: Real, top: Real, paint: Paint) -> list[Part]:
    """A wheel on a strut down from `top`."""
    wheel = parts.lathe(
        parts.disc_profile(radius, radius * 0.35, radius * 0.15), palette.TYRE, sides=14, axis="z", name="wheel"
    )
    return [wheel.moved(x, y, z), parts.beam((x, y, z), (x, top, z * 0.8), 0.01, paint, name="strut")]


def _propeller_plane(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """A light aircraft: straight high or low wing (or both), one propeller, fixed wheels."""
    width, height = rng.uniform(0.12, 0.16), rng.uniform(0.14, 0.19)
    stations = [
        (-0.5, 0.04, width * 0.12, height * 0.2),
        (-0.3, 0.025, width * 0.45, height * 0.45),
        (-0.05, 0.01, width * 0.9, height * 0.9),
        (0.12, 0.01, width, height),
        (0.3, -0.01, width * 0.9, height * 0.78),
        (0.45, -0.01, width * 0.62, height * 0.55),
    ]
    pieces = [_fuselage(stations, body, power=2.6)]
    canopy = parts.lathe(
        [(0.0, -0.14), (0.042, -0.1), (0.062, 0.0), (0.05, 0.07), (0.0, 0.12)],
        palette.GLASS,
        sides=14,
        axis="x",
        name="canopy",
    )
    pieces.append(canopy.scaled(1.0, 1.1, 0.85 * width / 0.12).moved(0.1, height * 0.44, 0))
    pieces += _propeller(rng, rng.uniform(0.11, 0.15), 0.455)
    root = rng.uniform(0.14, 0.2)
    layout = rng.choice(["high", "low", "biplane"], p=[0.4, 0.42, 0.18])
    spans = {"high": [0.46 * height + 0.02], "low": [-0.38 * height], "biplane": [-0.36 * height, 0.75 * height]}[
        str(layout)
    ]
    span = rng.uniform(0.48, 0.62)
    for level in spans:
        wing = _Wing(
            0.22, level, root, root * rng.uniform(0.55, 1.0), span, rng.uniform(0.0, 0.05), rng.uniform(0.0, 0.05), 0.13
        )
        pieces += parts.both_sides([_wing(wing, accent if rng.random() < 0.5 else body)])
    if layout != "low":
        far, low = 0.55 * span, -0.36 * height
        upper = spans[-1]
        strut_foot = (0.16, low, 0.08 if layout == "high" else far)
        pieces += parts.both_sides([parts.beam((0.16, upper, far), strut_foot, 0.01, body, name="strut")])
    for x, z in ((0.2, 0.1), (0.2, -0.1), (0.38 if rng.random() < 0.6 else -0.44, 0.0)):
        pieces += _wheel(
            x, -height * 0.5 - 0.05 if x > 0 else -0.02, z, 0.03 if x > 0 else 0.018, -0.02 if x > 0 else 0.03, body
        )
    return pieces + _tail(rng, body, accent, 0.05, t_tail=False, size=1.05)


def _twin(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """A turboprop transport: straight wing, two or four propellers."""
    width = rng.uniform(0.11, 0.14)
    fuselage, height = _tube_body(rng, body, width)
    high = rng.random() < 0.6
    root = rng.uniform(0.13, 0.17)
    wing = _Wing(
        rng.uniform(0.08, 0.14),
        (0.46 if high else -0.36) * height,
        root,
        root * rng.uniform(0.4, 0.7),
        rng.uniform(0.48, 0.6),
        rng.uniform(0.01, 0.06),
        0.0 if high else 0.04,
        0.14,
    )
    pieces = [fuselage, *parts.both_sides([_wing(wing, body)]), *_cockpit(width, height, 0.5)]
    pieces += _windows(rng, width, height, 0.33, -0.18)
    for share in [0.32] if rng.random() < 0.75 else [0.28, 0.52]:
        edge = wing.leading(share)
        pod = parts.lathe(
            [(0.0, -0.2), (0.02, -0.15), (0.034, -0.06), (0.032, 0.03), (0.022, 0.075)],
            accent,
            sides=14,
            axis="x",
            name="pod",
        )
        blades = _propeller(rng, rng.uniform(0.09, 0.115), 0.08)
        pieces += parts.both_sides([part.moved(*edge) for part in [pod, *blades]])
    return pieces + _tail(rng, body, accent, 0.34 * height, t_tail=rng.random() < 0.5)


def _fighter(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """A jet with a pointed nose, canopy, swept or delta wing, one or two fins, one or two nozzles."""
    width, height = rng.uniform(0.11, 0.17), rng.uniform(0.09, 0.12)
    stations = [
        (-0.46, 0, width * 0.8, height * 0.75),
        (-0.3, 0, width, height * 0.9),
        (-0.05, 0, width, height),
        (0.15, 0.005, width * 0.75, height),
        (0.3, 0.0, width * 0.45, height * 0.75),
        (0.42, -0.01, width * 0.22, height * 0.4),
        (0.54, -0.015, 0.004, 0.004),
    ]
    pieces = [_fuselage(stations, body, power=2.8)]
    canopy = parts.lathe(
        [(0.0, -0.13), (0.025, -0.08), (0.034, 0.0), (0.02, 0.07), (0.0, 0.11)],
        palette.GLASS,
        sides=14,
        axis="x",
        name="canopy",
    )
    pieces.append(canopy.scaled(1.0, 1.2, 0.8).moved(0.2, height * 0.42, 0))
    delta = style == "delta"
    root = rng.uniform(0.42, 0.55) if delta else rng.uniform(0.26, 0.34)
    span = rng.uniform(0.26, 0.36)
    wing = _Wing(
        x=-0.42 + root,
        y=rng.uniform(-0.2, 0.2) * height,
        root=root,
        tip=root * (rng.uniform(0.02, 0.12) if delta else rng.uniform(0.2, 0.4)),
        span=span,
        sweep=root * rng.uniform(0.8, 0.92) if delta else rng.uniform(0.14, 0.24),
        rise=rng.uniform(-0.02, 0.01),
        thickness=0.05,
    )
    pieces += parts.both_sides([_wing(wing, body, sheet=rng.random() < 0.2)])
    nozzles = [0.0] if rng.random() < 0.5 else [-width * 0.24, width * 0.24]
    radius = height * (0.42 if len(nozzles) == 1 else 0.34)
    nozzle = parts.lathe(
        [(radius * 0.75, -0.1), (radius, 0.0), (radius, 0.06)], palette.BLACK, sides=14, axis="x", name="nozzle"
    )
    pieces += [nozzle.moved(-0.45, 0, z) for z in nozzles]
    pieces += parts.both_sides(
        [parts.box((0.02, -0.1 * height, width * 0.52), (0.2, height * 0.62, width * 0.2), body, name="intake")]
    )
    fin = _Wing(-0.22, 0.0, 0.18, 0.08, rng.uniform(0.13, 0.18), rng.uniform(0.1, 0.16), 0.0, 0.06)
    if rng.random() < 0.5:
        pieces.append(_fin(fin, accent).moved(-0.02, height * 0.38, 0))
    else:
        pieces += parts.both_sides(
            [_fin(fin, accent).turned("x", rng.uniform(0.1, 0.35)).moved(-0.02, height * 0.3, width * 0.36)]
        )
    if not delta or rng.random() < 0.3:
        x = 0.22 if delta else -0.36
        small = _Wing(x, 0.0, 0.12, 0.05, rng.uniform(0.15, 0.2), 0.08, 0.0, 0.06)
        pieces += parts.both_sides([_wing(small, body, stations=3, name="tailplane")])
    if rng.random() < 0.5:
        missile = parts.lathe(
            [(0.0, -0.09), (0.01, -0.085), (0.01, 0.06), (0.0, 0.1)],
            palette.hsv(0, 0, 0.85),
            sides=8,
            axis="x",
            name="missile",
        )
        edge = wing.leading(0.55)
        pieces += parts.both_sides([missile.moved(edge[0] - 0.06, edge[1] - 0.022, edge[2])])
    return pieces
