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


def _airfoil() -> Float[np.ndarray, "s 2"]:
    """A symmetric section of unit chord and thickness, from the trailing edge over the top and back: (behind, up)."""
    t = (1 - np.cos(np.linspace(0, np.pi, 6))) / 2
    half = 5 * 0.2 * (1.4845 * np.sqrt(t) - 0.63 * t - 1.758 * t**2 + 1.4215 * t**3 - 0.518 * t**4)
    upper = np.stack([t[::-1], half[::-1]], axis=1)
    lower = np.stack([t[1:-1], -half[1:-1]], axis=1)
    return np.concatenate([upper, lower])


def wing_part(wing: Wing, paint: Paint, *, stations: int = 5, sheet: bool = False, name: str = "wing") -> Part:
    """The wing on the side of +Z, as a closed section or as an open sheet without thickness."""
    shares = np.linspace(0.0, 1.0, stations)
    return panels([(*wing.leading(share), wing.chord(share)) for share in shares], wing.thickness, paint, sheet, name)


def panels(
    lines: Sequence[Sequence[Real]], thickness: Real, paint: Paint, sheet: bool = False, name: str = "wing"
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


def kinked_wing(wing: Wing, kink: Real, paint: Paint) -> Part:
    """A wing whose inner third is deeper by a share `kink` of the root, behind its straight leading edge."""
    lines = []
    for share, more in ((0.0, kink), (0.33, 0.0), (1.0, 0.0)):
        lines.append((*wing.leading(share), wing.chord(share) + 0.4 * more * wing.root))
    return panels(lines, wing.thickness, paint)


def rounded_wing(wing: Wing, paint: Paint) -> Part:
    """A wing whose outline closes to the tip as an ellipse does."""
    lines = []
    for share in (0.0, 0.3, 0.55, 0.75, 0.88, 0.96, 1.0):
        chord = wing.chord(share) * max(np.sqrt(1 - share**2.5), 0.08)
        x, y, z = wing.leading(share)
        lines.append((x - 0.4 * (wing.chord(share) - chord), y, z, chord))
    return panels(lines, wing.thickness, paint)


def fin_part(wing: Wing, paint: Paint, name: str = "fin") -> Part:
    """A wing turned upright about the X axis: its span points up."""
    flat = wing_part(wing, paint, stations=3, name=name)
    return flat.turned("x", -np.pi / 2)


def fuselage(
    stations: Sequence[Sequence[Real]], paint: Paint, *, sides: int = 18, power: Real = 2.0, count: int = 24
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
        (-0.5, lift, width * 0.08, height * 0.12), (-0.4, lift * 0.8, width * 0.42, height * 0.46),
        (-0.26, lift * 0.25, width * 0.88, height * 0.9), (-0.15, 0, width, height), (0.1, 0, width, height),
        (0.5 - nose * 1.6, 0, width, height), (0.5 - nose * 0.7, -0.04 * height, width * 0.84, height * 0.84),
        (0.5 - nose * 0.15, -0.12 * height, width * 0.42, height * 0.42),
        (0.5, -0.14 * height, width * 0.06, height * 0.06),
    ]  # fmt: skip
    return fuselage(stations, paint), height


def turned(name: str, profile: Sequence[tuple[Real, Real]], paint: Paint = palette.GLASS, *, sides: int = 14) -> Part:
    """A surface of revolution about the X axis: (radius, x) from the rear to the front."""
    return parts.lathe(profile, paint, sides=sides, axis="x", name=name)


def canopy(width: Real, height: Real) -> Part:
    """A glass drop as wide as three quarters of the fuselage."""
    profile = [(0.0, -0.14), (0.7, -0.1), (1.0, 0.0), (0.8, 0.07), (0.0, 0.12)]
    return turned("canopy", profile).scaled(1.0, 0.42 * height, 0.38 * width)


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
    cowl = turned("nacelle", [(radius * r, length * x) for r, x in profile], paint, sides=16)
    fan = turned("fan", [(radius * 0.8, -0.22 * length), (0.0, -0.1 * length)], palette.BLACK, sides=16)
    profile = [(0.0, -1.25 * length), (radius * 0.5, -0.9 * length), (radius * 0.55, -0.8 * length)]
    cone = turned("cone", profile, palette.CHROME, sides=12)
    return [cowl, fan, cone]


def engine_pod(wing: Wing, share: Real, radius: Real, length: Real, drop: Real, paint: Paint) -> list[Part]:
    """An engine under the wing at a share of the span, with its pylon."""
    edge = wing.leading(share)
    x, y = edge[0] + 0.55 * length, edge[1] - drop
    pods = [part.moved(x, y, edge[2]) for part in nacelle(radius, length, paint)]
    top = edge[1] - 0.002
    wide = (edge[2] - 0.003, edge[2] + 0.003)
    foot = parts.rectangle((x - 0.9 * length, x - 0.15 * length), wide, y + radius * 0.85)
    head = parts.rectangle((edge[0] - 0.6 * wing.chord(share), edge[0] + 0.0), wide, top)
    pylon = parts.hexahedron(foot, head, paint, "pylon")
    return [*pods, pylon]


def propeller_pod(rng: np.random.Generator, wing: Wing, share: Real, radius: Real, paint: Paint) -> list[Part]:
    """A slender engine through the wing with its propeller."""
    reach = rng.uniform(0.04, 0.1)
    profile = [(0.0, -0.24), (0.6 * radius, -0.18), (radius, -0.06), (0.95 * radius, 0.03), (0.6 * radius, reach)]
    pod = turned("pod", profile, paint)
    blades = propeller(rng, rng.uniform(0.08, 0.125), reach + 0.005)
    return [part.moved(*wing.leading(share)) for part in [pod, *blades]]


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
    tip, sweep = chord * rng.uniform(0.35, 0.7), rng.uniform(0.02, 0.08)
    plane = Wing(x, y, chord, tip, span, sweep, 0.0 if t_tail else rng.uniform(0, 0.03), 0.09)
    return pieces + parts.both_sides([wing_part(plane, paint, stations=3, name="tailplane")])


def wide_tail(
    rng: np.random.Generator, paint: Paint, accent: Paint, top: Real, *, t_tail: bool, size: Real = 1.0, vee: Real = 0.0
) -> list[Part]:
    """Fin and tail plane as of `tail`, wider in range; with odds `vee` two fins that lean out in place of both."""
    size = size * rng.uniform(0.8, 1.2)
    if rng.random() < vee:
        blade = Wing(-0.36, 0.0, 0.13 * size, 0.07 * size, 0.22 * size, 0.05, 0.0, 0.09)
        leaning = fin_part(blade, accent).turned("x", rng.uniform(0.7, 1.0)).moved(0, top - 0.01, 0)
        return parts.both_sides([leaning])
    pieces = tail(rng, paint, accent, top, t_tail=t_tail, size=size)
    across = rng.uniform(0.85, 1.5)
    return [part.scaled(1.0, 1.0, across) if part.name == "tailplane" else part for part in pieces]


def cockpit(width: Real, height: Real) -> list[Part]:
    """The pilots' windows: a bent dark sheet over the nose."""
    angle, x = np.meshgrid(np.linspace(-1.0, 1.0, 9), np.array([0.5 - 0.05, 0.5 - 0.032]), indexing="ij")
    scale = np.where(x < 0.5 - 0.04, 0.475, 0.40)
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
    foot = np.array([[-0.004, 0, 0.008], [0.004, 0, 0.008], [0.004, 0, -0.008], [-0.004, 0, -0.008]])
    tip = [[-0.001, radius, 0.012], [0.003, radius, 0.012], [0.001, radius, -0.012], [-0.003, radius, -0.012]]
    blade = parts.hexahedron(foot, np.array(tip), palette.BLACK, "blade")
    spinner = turned("spinner", [(0.022, -0.02), (0.019, 0.01), (0.01, 0.03), (0.0, 0.038)], palette.CHROME, sides=12)
    blades = [blade.turned("x", start + 2 * np.pi * k / count) for k in range(count)]
    return [part.moved(x) for part in [*blades, spinner]]


def wheel(x: Real, y: Real, z: Real, radius: Real, top: Real, paint: Paint) -> list[Part]:
    """A wheel on a strut down from `top`."""
    profile = parts.disc_profile(radius, radius * 0.35, radius * 0.15)
    wheel = parts.lathe(profile, palette.TYRE, sides=14, axis="z", name="wheel")
    return [wheel.moved(x, y, z), parts.beam((x, y, z), (x, top, z * 0.8), 0.01, paint, name="strut")]


def gear(wing: Wing, width: Real, height: Real, paint: Paint) -> list[Part]:
    """Lowered wheels: a pair under the nose, two pairs under the wing."""
    axles = [(0.38, 0.006, 0.015), (wing.x - 0.6 * wing.root, width * 0.55, 0.02)]
    places = [(x, across, radius) for x, z, radius in axles for across in (z, z + radius * 1.3)]
    wheels = [wheel(x, -height * 0.5 - 0.035, across, radius, -0.25 * height, paint) for x, across, radius in places]
    return parts.both_sides(itertools.chain(*wheels))


def floats(height: Real, paint: Paint) -> list[Part]:
    """A seaplane's two floats on struts."""
    y = -height * 0.5 - 0.08
    tail, nose = (-0.3, y + 0.01, 0.01, 0.01), (0.42, y + 0.02, 0.01, 0.01)
    stations = [tail, (-0.1, y, 0.045, 0.04), (0.2, y, 0.05, 0.05), nose]
    hull = fuselage(stations, paint, sides=12, power=2.6, count=14).moved(0, 0, 0.12)
    struts = [parts.beam((x, y, 0.12), (x, -height * 0.35, 0.04), 0.01, paint, name="strut") for x in (0.02, 0.22)]
    return parts.both_sides([hull, *struts])
