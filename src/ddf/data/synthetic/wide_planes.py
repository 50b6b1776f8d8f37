"""Aeroplanes of more layouts than those of `planes`: any wing on any fuselage, engines in several places, V-tails."""

import numpy as np

from ddf.data.synthetic import palette, parts, plane_parts, planes
from ddf.data.synthetic.parts import Paint, Part, Real
from ddf.data.synthetic.plane_parts import Wing

OLD = 0.2  # of all: as `planes` builds them, stretched
STRETCH = (0.85, 1.18)  # across and up
STYLES = ("jetliner", "tailjet", "commuter", "light", "biplane", "sailplane", "fighter", "tailless")
STYLE_ODDS = (0.26, 0.16, 0.17, 0.15, 0.03, 0.12, 0.08, 0.03)


def build(rng: np.random.Generator) -> list[Part]:
    """One aeroplane."""
    if rng.random() < OLD:
        up, across = rng.uniform(*STRETCH, 2)
        return [part.scaled(1.0, up, across) for part in planes.build(rng)]
    style = str(rng.choice(STYLES, p=STYLE_ODDS))
    body, accent = palette.plane(rng)
    builders = {
        "jetliner": _transport,
        "tailjet": _transport,
        "commuter": _transport,
        "light": _light,
        "biplane": _light,
        "sailplane": _sailplane,
        "fighter": _fighter,
        "tailless": _tailless,
    }
    return builders[style](rng, body, accent, style)


def _transport(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """Jets under the wing or at the tail, or propellers before it."""
    low, high = {"jetliner": (0.08, 0.13), "tailjet": (0.07, 0.14), "commuter": (0.085, 0.15)}[style]
    width = rng.uniform(low, high)
    fuselage, height = plane_parts.tube_body(rng, body, width)
    straight, at_tail = style == "commuter", style == "tailjet"
    above = rng.random() < {"jetliner": 0.1, "tailjet": 0.0, "commuter": 0.4}[style]
    root = rng.uniform(0.12, 0.19) if straight else rng.uniform(0.16, 0.26)
    wing = Wing(
        x=rng.uniform(0.06, 0.16) if straight else rng.uniform(0.0, 0.1) if at_tail else rng.uniform(0.1, 0.2),
        y=(0.46 if above else rng.uniform(-0.42, -0.25)) * height,
        root=root,
        tip=root * (rng.uniform(0.35, 0.8) if straight else rng.uniform(0.18, 0.4)),
        span=rng.uniform(0.4, 0.68) if straight else rng.uniform(0.33, 0.54),
        sweep=rng.uniform(0.0, 0.07) if straight else rng.uniform(0.12, 0.3),
        rise=rng.uniform(-0.04, 0.01) if above else rng.uniform(0.01, 0.07),
        thickness=rng.uniform(0.09, 0.15),
    )
    kink = 0.0 if straight else rng.uniform(0.15, 0.7)
    pieces = [fuselage, *parts.both_sides([_kinked(wing, kink, body)]), *plane_parts.cockpit(width, height, 0.5)]
    pieces += plane_parts.windows(rng, width, height, 0.34, -0.2) if rng.random() < 0.6 else []
    paint = accent if rng.random() < 0.3 else body
    radius = rng.uniform(0.024, 0.042)
    if at_tail:
        pieces += parts.both_sides(
            plane_parts.tail_engines(paint, width * 0.85, height, radius, radius * rng.uniform(3.2, 5.5))
        )
    else:
        four = rng.random() < 0.15
        for share in (0.28, 0.52) if four else (rng.uniform(0.28, 0.38),):
            if straight:
                pieces += parts.both_sides(_propeller_pod(rng, wing, share, radius * 0.9, paint))
            else:
                size = radius * (0.85 if four else 1.0)
                pieces += parts.both_sides(
                    plane_parts.engine_pod(wing, share, size, size * rng.uniform(3, 4.5), size * 1.25, paint)
                )
    if rng.random() < (0.15 if straight else 0.4):
        pieces += parts.both_sides([plane_parts.winglet(wing, accent)])
    if rng.random() < 0.25:
        pieces += planes.gear(wing, width, height, body)
    on_top = {"jetliner": 0.03, "tailjet": 0.95, "commuter": 0.35}[style]
    return pieces + _tail(rng, body, accent, 0.32 * height, on_top=rng.random() < on_top)


def _light(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """One propeller in the nose, a cabin under a high wing or a canopy over a low one, or two wings."""
    width, height = rng.uniform(0.1, 0.17), rng.uniform(0.12, 0.19)
    nose = rng.uniform(0.45, 0.95)
    stations = [
        (-0.5, 0.03, width * 0.12, height * 0.2),
        (-0.28, 0.02, width * rng.uniform(0.35, 0.6), height * 0.5),
        (-0.02, 0.01, width * 0.9, height * 0.9),
        (0.12, 0.01, width, height),
        (0.3, -0.01, width * 0.95, height * rng.uniform(0.65, 0.9)),
        (0.45, -0.015, width * nose, height * 0.8 * nose),
    ]
    pieces = [plane_parts.fuselage(stations, body, power=rng.uniform(2.0, 3.2))]
    levels = [-0.4 * height, 0.9 * height] if style == "biplane" else [rng.choice([-0.4, 0.5]) * height]
    high = levels[-1] > 0
    if style == "light" and high:
        cabin = parts.box((0.08, 0.35 * height, 0), (0.3, 0.4 * height, 0.85 * width), palette.GLASS, taper=(0.7, 0.9))
        pieces.append(cabin)
    else:
        pieces.append(_canopy(width, height).moved(rng.uniform(0.0, 0.1), 0.42 * height, 0))
    pieces += plane_parts.propeller(rng, rng.uniform(0.11, 0.17), 0.455)
    root, span = rng.uniform(0.14, 0.24), rng.uniform(0.45, 0.8) if style == "light" else rng.uniform(0.4, 0.6)
    taper, round_tip = rng.uniform(0.5, 1.0), rng.random() < 0.45
    x, rise = rng.uniform(0.18, 0.28), rng.uniform(0.0, 0.02 if high else 0.08)
    for k, level in enumerate(levels):
        wing = Wing(x + 0.04 * k, level, root, root * taper, span, rng.uniform(0.0, 0.06), rise, 0.13)
        paint = accent if rng.random() < 0.4 else body
        pieces += parts.both_sides([_rounded(wing, paint) if round_tip else plane_parts.wing_part(wing, paint)])
    if high and rng.random() < (1.0 if style == "biplane" else 0.6):
        foot = 0.6 * span if style == "biplane" else 0.25 * width
        lower = (x - 0.08, -0.4 * height + (0.6 * rise if style == "biplane" else 0.0), foot)
        upper = (x - 0.08, levels[-1] + 0.6 * rise, 0.6 * span)
        pieces += parts.both_sides([parts.beam(upper, lower, 0.01, body, name="strut")])
        if style == "biplane":
            inner = parts.beam((x - 0.06, 0.9 * height, 0.3 * width), (x - 0.06, 0.3 * height, 0.3 * width), 0.01, body)
            pieces += parts.both_sides([inner])
    if rng.random() < 0.75:
        ground = -0.5 * height - rng.uniform(0.03, 0.08)
        for place, z in ((0.2, 0.11), (0.2, -0.11), (0.38 if rng.random() < 0.5 else -0.44, 0.0)):
            far = place < 0
            pieces += plane_parts.wheel(
                place, -0.03 if far else ground, z, 0.018 if far else 0.03, 0.03 if far else -0.2 * height, body
            )
    return pieces + _tail(rng, body, accent, 0.05, on_top=rng.random() < 0.08)


def _sailplane(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """A glider, or a model of one: slender pod, thin boom, long wing of two panels, any tail."""
    width = rng.uniform(0.04, 0.1)
    boom = rng.uniform(0.12, 0.35)
    lift = rng.uniform(0.0, 0.03)
    stations = [
        (-0.5, lift, width * 0.14, width * 0.16),
        (-0.15, 0.7 * lift, width * boom, width * boom),
        (0.1, 0.0, width * 0.8, width),
        (0.3, -0.01, width, width * 1.15),
        (0.44, -0.015, width * 0.6, width * 0.7),
        (0.5, -0.02, 0.006, 0.006),
    ]
    root, span = rng.uniform(0.09, 0.2), rng.uniform(0.6, 1.15)
    tip, rise, bent = root * rng.uniform(0.3, 0.7), rng.uniform(0.0, 0.08), rng.uniform(0.0, 0.12)
    x, y = rng.uniform(0.08, 0.24), rng.uniform(-0.1, 0.45) * width
    share = rng.uniform(0.4, 0.7)
    lines = [
        (x, y, 0.0, root),
        (x - 0.01, y + share * rise, share * span, root * 0.92),
        (x - 0.03, y + rise + (1 - share) * bent, span, tip),
    ]
    pieces = [
        plane_parts.fuselage(stations, body),
        *parts.both_sides([plane_parts.panels(lines, 0.11, accent if rng.random() < 0.3 else body)]),
    ]
    if rng.random() < 0.6:
        pieces.append(_canopy(width * 0.8, width).moved(0.28, 0.3 * width, 0))
    return pieces + _tail(rng, body, accent, lift, on_top=rng.random() < 0.45, size=rng.uniform(0.65, 1.1), vee=0.25)


def _fighter(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """The jets of `planes`, of other proportions."""
    wide, up = rng.uniform(0.8, 1.5), rng.uniform(0.75, 1.3)
    kind = str(rng.choice(["fighter", "delta"]))
    return [part.scaled(1.0, up, wide) for part in planes.fighter(rng, body, accent, kind)]


def _tailless(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """A swept or round flying wing with a short pod and fins at its tips or in the middle."""
    root, span, sweep = rng.uniform(0.3, 0.8), rng.uniform(0.5, 1.0), rng.uniform(0.1, 0.5)
    wing = Wing(0.3, 0.0, root, root * rng.uniform(0.3, 0.7), span, sweep, rng.uniform(0.0, 0.04), 0.09)
    long = rng.uniform(0.6, 1.0) * root
    width = rng.uniform(0.08, 0.16)
    stations = [
        (0.28 - long, 0.0, 0.01, 0.01),
        (0.3 - 0.6 * long, 0.01, width, width * 0.7),
        (0.32, 0.01, width, width * 0.7),
        (0.45, 0.0, 0.01, 0.01),
    ]
    fin = Wing(0.0, 0.0, 0.14, 0.08, rng.uniform(0.08, 0.16), 0.08, 0.0, 0.08)
    end = wing.leading(1.0) + np.array([0.14 - wing.tip, -0.01, -0.01])
    fins = parts.both_sides([plane_parts.fin_part(fin, accent).moved(*end)])
    if rng.random() < 0.4 and root > 0.45:
        fins = [plane_parts.fin_part(fin, accent).moved(0.42 - root, 0.0, 0.0)]
    main = _rounded(wing, body) if rng.random() < 0.4 else plane_parts.wing_part(wing, body)
    return [plane_parts.fuselage(stations, accent), *parts.both_sides([main]), *fins]


def _kinked(wing: Wing, kink: Real, paint: Paint) -> Part:
    """A wing whose inner third is deeper by a share `kink` of the root, behind its straight leading edge."""
    lines = []
    for share, more in ((0.0, kink), (0.33, 0.0), (1.0, 0.0)):
        lines.append((*wing.leading(share), wing.chord(share) + 0.4 * more * wing.root))
    return plane_parts.panels(lines, wing.thickness, paint)


def _rounded(wing: Wing, paint: Paint) -> Part:
    """A wing whose outline closes to the tip as an ellipse does."""
    lines = []
    for share in (0.0, 0.3, 0.55, 0.75, 0.88, 0.96, 1.0):
        chord = wing.chord(share) * max(np.sqrt(1 - share**2.5), 0.08)
        x, y, z = wing.leading(share)
        lines.append((x - 0.4 * (wing.chord(share) - chord), y, z, chord))
    return plane_parts.panels(lines, wing.thickness, paint)


def _canopy(width: Real, height: Real) -> Part:
    """A glass drop as wide as three quarters of the fuselage."""
    profile = [(0.0, -0.14), (0.7, -0.1), (1.0, 0.0), (0.8, 0.07), (0.0, 0.12)]
    drop = parts.lathe(profile, palette.GLASS, sides=14, axis="x", name="canopy")
    return drop.scaled(1.0, 0.42 * height, 0.38 * width)


def _propeller_pod(rng: np.random.Generator, wing: Wing, share: Real, radius: Real, paint: Paint) -> list[Part]:
    """A slender engine through the wing with its propeller."""
    reach = rng.uniform(0.04, 0.1)
    profile = [(0.0, -0.24), (0.6 * radius, -0.18), (radius, -0.06), (0.95 * radius, 0.03), (0.6 * radius, reach)]
    pod = parts.lathe(profile, paint, sides=14, axis="x", name="pod")
    blades = plane_parts.propeller(rng, rng.uniform(0.08, 0.125), reach + 0.005)
    return [part.moved(*wing.leading(share)) for part in [pod, *blades]]


def _tail(
    rng: np.random.Generator,
    paint: Paint,
    accent: Paint,
    top: Real,
    *,
    on_top: bool,
    size: Real = 1.0,
    vee: Real = 0.0,
) -> list[Part]:
    """Fin and tail plane as of `planes`, wider in range; with odds `vee` two fins that lean out in place of both."""
    size = size * rng.uniform(0.8, 1.2)
    if rng.random() < vee:
        blade = Wing(-0.36, 0.0, 0.13 * size, 0.07 * size, 0.22 * size, 0.05, 0.0, 0.09)
        leaning = plane_parts.fin_part(blade, accent).turned("x", rng.uniform(0.7, 1.0)).moved(0, top - 0.01, 0)
        return parts.both_sides([leaning])
    pieces = plane_parts.tail(rng, paint, accent, top, t_tail=on_top, size=size)
    across = rng.uniform(0.85, 1.5)
    return [part.scaled(1.0, 1.0, across) if part.name == "tailplane" else part for part in pieces]
