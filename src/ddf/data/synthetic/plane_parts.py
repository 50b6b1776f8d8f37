"""Wings, fuselages, engines, tails and propellers of aeroplanes, nose to +X, in fuselage lengths."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ddf.data.synthetic import palette, parts
from ddf.data.synthetic.parts import Paint, Part, Real


@dataclass(frozen=True)
class Wing:
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


def _airfoil(count: int = 6) -> Float[np.ndarray, "s 2"]:
    """A symmetric section of unit chord and thickness, from the trailing edge over the top and back: (behind, up)."""
    t = (1 - np.cos(np.linspace(0, np.pi, count))) / 2
    half = 5 * 0.2 * (1.4845 * np.sqrt(t) - 0.63 * t - 1.758 * t**2 + 1.4215 * t**3 - 0.518 * t**4)
    upper = np.stack([t[::-1], half[::-1]], axis=1)
    lower = np.stack([t[1:-1], -half[1:-1]], axis=1)
    return np.concatenate([upper, lower])


def wing_part(wing: Wing, paint: Paint, *, stations: int = 5, sheet: bool = False, name: str = "wing") -> Part:
    """The wing on the side of +Z, as a closed section or as an open sheet without thickness."""
    shares = np.linspace(0.0, 1.0, stations)
    return panels([(*wing.leading(share), wing.chord(share)) for share in shares], wing.thickness, paint, sheet, name)


def panels(
    lines: Sequence[tuple[Real, Real, Real, Real]],
    thickness: Real,
    paint: Paint,
    sheet: bool = False,
    name: str = "wing",
) -> Part:
    """A surface through (leading edge's x, y, z, chord), from the root outwards; as of `wing_part`."""
    outline = _airfoil()
    sections = []
    for x, y, z, chord in lines:
        up = outline[:, 1] * thickness * chord
        sections.append(np.stack([x - outline[:, 0] * chord, y + up, np.full(len(up), z)], axis=1))
    points = np.stack(sections)
    if sheet:
        return parts.grid(points[:, : len(outline) // 2 + 1], paint, name=name)
    return parts.loft(points, paint, name=name)


def fin_part(wing: Wing, paint: Paint, name: str = "fin") -> Part:
    """A wing turned upright about the X axis: its span points up."""
    flat = wing_part(wing, paint, stations=3, name=name)
    return flat.turned("x", -np.pi / 2)


def fuselage(
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


def tube_body(rng: np.random.Generator, paint: Paint, width: Real) -> tuple[Part, Real]:
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
    return fuselage(stations, paint), height


def windows(rng: np.random.Generator, width: Real, height: Real, front: Real, rear: Real) -> list[Part]:
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


def nacelle(radius: Real, length: Real, paint: Paint) -> list[Part]:
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


def engine_pod(wing: Wing, share: Real, radius: Real, length: Real, drop: Real, paint: Paint) -> list[Part]:
    """An engine under the wing at a share of the span, with its pylon."""
    edge = wing.leading(share)
    x, y = edge[0] + 0.55 * length, edge[1] - drop
    pods = [part.moved(x, y, edge[2]) for part in nacelle(radius, length, paint)]
    top = edge[1] - 0.002
    pylon = parts.hexahedron(
        parts.rectangle((x - 0.9 * length, x - 0.15 * length), (edge[2] - 0.003, edge[2] + 0.003), y + radius * 0.85),
        parts.rectangle((edge[0] - 0.6 * wing.chord(share), edge[0] + 0.0), (edge[2] - 0.003, edge[2] + 0.003), top),
        paint,
        "pylon",
    )
    return [*pods, pylon]


def tail(
    rng: np.random.Generator, paint: Paint, accent: Paint, top: Real, *, t_tail: bool, size: Real = 1.0
) -> list[Part]:
    """Fin and tail plane; on a T-tail the plane sits on top of the fin."""
    height = rng.uniform(0.14, 0.19) * size
    sweep = rng.uniform(0.07, 0.14) * size
    root = rng.uniform(0.13, 0.18) * size
    fin = Wing(-0.5 + root + 0.03, 0.0, root, root * rng.uniform(0.35, 0.6), height, sweep, 0.0, 0.1)
    pieces = [fin_part(fin, accent).moved(0, top, 0)]
    span = rng.uniform(0.13, 0.19) * size
    chord = rng.uniform(0.07, 0.1) * size
    x, y = -0.5 + chord + 0.03, top * 0.6
    if t_tail:
        x, y = fin.leading(0.95)[0] + 0.01, top + 0.96 * height
    plane = Wing(
        x,
        y,
        chord,
        chord * rng.uniform(0.35, 0.7),
        span,
        rng.uniform(0.02, 0.08),
        0.0 if t_tail else rng.uniform(0, 0.03),
        0.09,
    )
    return pieces + parts.both_sides([wing_part(plane, paint, stations=3, name="tailplane")])


def cockpit(width: Real, height: Real, nose: Real) -> list[Part]:
    """The pilots' windows: a bent dark sheet over the nose."""
    angle, x = np.meshgrid(np.linspace(-1.0, 1.0, 9), np.array([nose - 0.05, nose - 0.032]), indexing="ij")
    scale = np.where(x < nose - 0.04, 0.475, 0.40)
    points = np.stack([x, height * (scale * np.cos(angle) * 0.92 - 0.05), width * scale * np.sin(angle)], axis=-1)
    return [parts.grid(points, palette.GLASS, name="screen")]


def winglet(wing: Wing, paint: Paint) -> Part:
    """A small upturned blade at the wing tip."""
    tip = wing.leading(1.0)
    blade = Wing(0.0, 0.0, wing.tip, wing.tip * 0.4, 0.05, 0.05, 0.0, 0.1)
    return fin_part(blade, paint, "winglet").turned("x", 0.25).moved(tip[0], tip[1], tip[2] - 0.002)


def tail_engines(paint: Paint, width: Real, height: Real, radius: Real, length: Real) -> list[Part]:
    """One engine on a stub at the rear fuselage, side of +Z."""
    x, y, z = -0.2, 0.18 * height, width / 2 + radius * 1.15
    stub = parts.box((x - 0.5 * length, y, z - radius), (0.6 * length, 0.012, radius * 2), paint, name="stub")
    return [*(part.moved(x, y, z) for part in nacelle(radius, length, paint)), stub]


def propeller(rng: np.random.Generator, radius: Real, x: Real) -> list[Part]:
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


def wheel(x: Real, y: Real, z: Real, radius: Real, top: Real, paint: Paint) -> list[Part]:
    """A wheel on a strut down from `top`."""
    wheel = parts.lathe(
        parts.disc_profile(radius, radius * 0.35, radius * 0.15), palette.TYRE, sides=14, axis="z", name="wheel"
    )
    return [wheel.moved(x, y, z), parts.beam((x, y, z), (x, top, z * 0.8), 0.01, paint, name="strut")]
