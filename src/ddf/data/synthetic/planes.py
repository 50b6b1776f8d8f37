"""Aeroplanes: airliners, business jets, propeller planes, fighters; nose to +X, wings along Z, in fuselage lengths."""

import numpy as np

from ddf.data.synthetic import palette, parts, plane_parts
from ddf.data.synthetic.parts import Paint, Part, Real

STYLES = ("airliner", "business", "propeller", "twin", "fighter", "delta", "supersonic", "glider")
STYLE_ODDS = (0.35, 0.12, 0.15, 0.1, 0.13, 0.08, 0.04, 0.03)


def build(rng: np.random.Generator) -> list[Part]:
    """One aeroplane."""
    style = str(rng.choice(STYLES, p=STYLE_ODDS))
    body, accent = palette.plane(rng)
    builders = {
        "airliner": _airliner,
        "business": _business,
        "propeller": _propeller_plane,
        "twin": _twin,
        "fighter": fighter,
        "delta": fighter,
        "supersonic": _supersonic,
        "glider": _glider,
    }
    return builders[style](rng, body, accent, style)


def _airliner(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """Swept low wing, two or four engines under it (or two at the tail)."""
    width = rng.uniform(0.085, 0.125)
    fuselage, height = plane_parts.tube_body(rng, body, width)
    root = rng.uniform(0.17, 0.24)
    wing = plane_parts.Wing(
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
    third = rng.random() < (0.4 if at_tail else 0.1)
    pieces = [fuselage, *parts.both_sides([plane_parts.wing_part(wing, body, sheet=rng.random() < 0.15)])]
    pieces += plane_parts.windows(rng, width, height, 0.36, -0.2) if rng.random() < 0.7 else []
    pieces += plane_parts.cockpit(width, height, 0.5)
    engine = rng.uniform(0.026, 0.037)
    length = engine * rng.uniform(3.2, 4.4)
    if at_tail:
        pieces += parts.both_sides(plane_parts.tail_engines(body, width, height, engine * 0.85, length))
    else:
        shares = [0.33] if rng.random() < 0.68 else [0.27, 0.52]
        for share in shares:
            scale = 1.0 if len(shares) == 1 else 0.8
            pieces += parts.both_sides(
                plane_parts.engine_pod(
                    wing,
                    share,
                    engine * scale,
                    length * scale,
                    engine * scale * 1.25,
                    accent if rng.random() < 0.3 else body,
                )
            )
    if rng.random() < 0.45:
        pieces += parts.both_sides([plane_parts.winglet(wing, accent)])
    if rng.random() < 0.3:
        pieces += gear(wing, width, height, body)
    if third:
        pieces += [part.moved(-0.28, 0.5 * height, 0) for part in plane_parts.nacelle(engine * 0.85, 0.2, accent)]
    return pieces + plane_parts.tail(rng, body, accent, 0.32 * height, t_tail=at_tail)


def gear(wing: plane_parts.Wing, width: Real, height: Real, paint: Paint) -> list[Part]:
    """Lowered wheels: a pair under the nose, two pairs under the wing."""
    axles = [(0.38, 0.006, 0.015), (wing.x - 0.6 * wing.root, width * 0.55, 0.02)]
    wheels = []
    for x, z, radius in axles:
        for across in (z, z + radius * 1.3):
            wheels += plane_parts.wheel(x, -height * 0.5 - 0.035, across, radius, -0.25 * height, paint)
    return parts.both_sides(wheels)


def _business(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """Engines at the tail, T-tail, wing further back."""
    width = rng.uniform(0.11, 0.15)
    fuselage, height = plane_parts.tube_body(rng, body, width)
    root = rng.uniform(0.2, 0.26)
    wing = plane_parts.Wing(
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
    pieces = [
        fuselage,
        *parts.both_sides([plane_parts.wing_part(wing, body)]),
        *plane_parts.cockpit(width, height, 0.5),
    ]
    pieces += plane_parts.windows(rng, width, height, 0.28, -0.08)
    pieces += parts.both_sides(plane_parts.tail_engines(accent, width * 0.8, height, radius, radius * 4.2))
    if rng.random() < 0.6:
        pieces += parts.both_sides([plane_parts.winglet(wing, accent)])
    return pieces + plane_parts.tail(rng, body, accent, 0.36 * height, t_tail=rng.random() < 0.85, size=1.1)


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
    pieces = [plane_parts.fuselage(stations, body, power=2.6)]
    canopy = parts.lathe(
        [(0.0, -0.14), (0.042, -0.1), (0.062, 0.0), (0.05, 0.07), (0.0, 0.12)],
        palette.GLASS,
        sides=14,
        axis="x",
        name="canopy",
    )
    pieces.append(canopy.scaled(1.0, 1.1, 0.85 * width / 0.12).moved(0.1, height * 0.44, 0))
    pieces += plane_parts.propeller(rng, rng.uniform(0.11, 0.15), 0.455)
    root = rng.uniform(0.14, 0.2)
    layout = rng.choice(["high", "low", "biplane"], p=[0.4, 0.42, 0.18])
    spans = {"high": [0.46 * height + 0.02], "low": [-0.38 * height], "biplane": [-0.36 * height, 0.75 * height]}[
        str(layout)
    ]
    span = rng.uniform(0.48, 0.62)
    for level in spans:
        wing = plane_parts.Wing(
            0.22, level, root, root * rng.uniform(0.55, 1.0), span, rng.uniform(0.0, 0.05), rng.uniform(0.0, 0.05), 0.13
        )
        pieces += parts.both_sides([plane_parts.wing_part(wing, accent if rng.random() < 0.5 else body)])
    if layout != "low":
        far, low = 0.55 * span, -0.36 * height
        upper = spans[-1]
        strut_foot = (0.16, low, 0.08 if layout == "high" else far)
        pieces += parts.both_sides([parts.beam((0.16, upper, far), strut_foot, 0.01, body, name="strut")])
    for x, z in ((0.2, 0.1), (0.2, -0.1), (0.38 if rng.random() < 0.6 else -0.44, 0.0)):
        pieces += plane_parts.wheel(
            x, -height * 0.5 - 0.05 if x > 0 else -0.02, z, 0.03 if x > 0 else 0.018, -0.02 if x > 0 else 0.03, body
        )
    if rng.random() < 0.15:
        pieces += _floats(height, accent)
    return pieces + plane_parts.tail(rng, body, accent, 0.05, t_tail=False, size=1.05)


def _floats(height: Real, paint: Paint) -> list[Part]:
    """A seaplane's two floats on struts."""
    y = -height * 0.5 - 0.08
    stations = [
        (-0.3, y + 0.01, 0.01, 0.01),
        (-0.1, y, 0.045, 0.04),
        (0.2, y, 0.05, 0.05),
        (0.42, y + 0.02, 0.01, 0.01),
    ]
    hull = plane_parts.fuselage(stations, paint, sides=12, power=2.6, count=14).moved(0, 0, 0.12)
    struts = [parts.beam((x, y, 0.12), (x, -height * 0.35, 0.04), 0.01, paint, name="strut") for x in (0.02, 0.22)]
    return parts.both_sides([hull, *struts])


def _twin(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """A turboprop transport: straight wing, two or four propellers."""
    width = rng.uniform(0.11, 0.14)
    fuselage, height = plane_parts.tube_body(rng, body, width)
    high = rng.random() < 0.6
    root = rng.uniform(0.13, 0.17)
    wing = plane_parts.Wing(
        rng.uniform(0.08, 0.14),
        (0.46 if high else -0.36) * height,
        root,
        root * rng.uniform(0.4, 0.7),
        rng.uniform(0.48, 0.6),
        rng.uniform(0.01, 0.06),
        0.0 if high else 0.04,
        0.14,
    )
    pieces = [
        fuselage,
        *parts.both_sides([plane_parts.wing_part(wing, body)]),
        *plane_parts.cockpit(width, height, 0.5),
    ]
    pieces += plane_parts.windows(rng, width, height, 0.33, -0.18)
    for share in [0.32] if rng.random() < 0.75 else [0.28, 0.52]:
        edge = wing.leading(share)
        pod = parts.lathe(
            [(0.0, -0.2), (0.02, -0.15), (0.034, -0.06), (0.032, 0.03), (0.022, 0.075)],
            accent,
            sides=14,
            axis="x",
            name="pod",
        )
        blades = plane_parts.propeller(rng, rng.uniform(0.09, 0.115), 0.08)
        pieces += parts.both_sides([part.moved(*edge) for part in [pod, *blades]])
    return pieces + plane_parts.tail(rng, body, accent, 0.34 * height, t_tail=rng.random() < 0.5)


def fighter(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
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
    pieces = [plane_parts.fuselage(stations, body, power=2.8)]
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
    wing = plane_parts.Wing(
        x=-0.42 + root,
        y=rng.uniform(-0.2, 0.2) * height,
        root=root,
        tip=root * (rng.uniform(0.02, 0.12) if delta else rng.uniform(0.2, 0.4)),
        span=span,
        sweep=root * rng.uniform(0.8, 0.92) if delta else rng.uniform(0.14, 0.24),
        rise=rng.uniform(-0.02, 0.01),
        thickness=0.05,
    )
    pieces += parts.both_sides([plane_parts.wing_part(wing, body, sheet=rng.random() < 0.2)])
    nozzles = [0.0] if rng.random() < 0.5 else [-width * 0.24, width * 0.24]
    radius = height * (0.42 if len(nozzles) == 1 else 0.34)
    nozzle = parts.lathe(
        [(radius * 0.75, -0.1), (radius, 0.0), (radius, 0.06)], palette.BLACK, sides=14, axis="x", name="nozzle"
    )
    pieces += [nozzle.moved(-0.45, 0, z) for z in nozzles]
    pieces += parts.both_sides(
        [parts.box((0.02, -0.1 * height, width * 0.52), (0.2, height * 0.62, width * 0.2), body, name="intake")]
    )
    fin = plane_parts.Wing(-0.22, 0.0, 0.18, 0.08, rng.uniform(0.13, 0.18), rng.uniform(0.1, 0.16), 0.0, 0.06)
    if rng.random() < 0.5:
        pieces.append(plane_parts.fin_part(fin, accent).moved(-0.02, height * 0.38, 0))
    else:
        pieces += parts.both_sides(
            [
                plane_parts.fin_part(fin, accent)
                .turned("x", rng.uniform(0.1, 0.35))
                .moved(-0.02, height * 0.3, width * 0.36)
            ]
        )
    if not delta or rng.random() < 0.3:
        x = 0.22 if delta else -0.36
        small = plane_parts.Wing(x, 0.0, 0.12, 0.05, rng.uniform(0.15, 0.2), 0.08, 0.0, 0.06)
        pieces += parts.both_sides([plane_parts.wing_part(small, body, stations=3, name="tailplane")])
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


def _supersonic(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """A slender airliner with an ogival delta wing, four engine boxes under it, and no tail plane."""
    width = rng.uniform(0.05, 0.065)
    droop = rng.uniform(0.0, 0.02)
    stations = [
        (-0.5, 0.012, 0.006, 0.008),
        (-0.36, 0.006, width * 0.7, width * 0.75),
        (-0.15, 0, width, width * 1.1),
        (0.25, 0, width, width * 1.1),
        (0.4, -0.2 * droop, width * 0.7, width * 0.75),
        (0.5, -droop, 0.004, 0.004),
    ]
    span = rng.uniform(0.2, 0.26)
    inner = plane_parts.Wing(0.2, -0.3 * width, 0.58, 0.36, span * 0.45, 0.24, 0.0, 0.025)
    tip = inner.leading(1.0)
    outer = plane_parts.Wing(tip[0], tip[1], 0.36, 0.06, span * 0.55, 0.25, -0.006, 0.025)
    pods = [
        parts.box((-0.27, -0.3 * width - 0.022, span * share), (0.2, 0.03, 0.04), accent, name="engine")
        for share in (0.35, 0.55)
    ]
    fin = plane_parts.Wing(-0.2, 0.0, 0.22, 0.07, rng.uniform(0.09, 0.12), 0.14, 0.0, 0.05)
    wings = [plane_parts.wing_part(inner, body), plane_parts.wing_part(outer, body).moved(0, 0, span * 0.45 - 0.001)]
    return [
        plane_parts.fuselage(stations, body),
        *parts.both_sides([*wings, *pods]),
        plane_parts.fin_part(fin, accent).moved(-0.03, width * 0.4, 0),
    ]


def _glider(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """A sailplane: very long wing, thin tail boom, glass nose."""
    width = rng.uniform(0.075, 0.095)
    stations = [
        (-0.5, 0.02, 0.012, 0.014),
        (-0.2, 0.015, width * 0.3, width * 0.34),
        (0.05, 0.0, width * 0.85, width * 1.0),
        (0.25, -0.01, width, width * 1.15),
        (0.42, -0.015, width * 0.6, width * 0.7),
        (0.5, -0.02, 0.006, 0.006),
    ]
    canopy = parts.lathe(
        [(0.0, -0.14), (0.03, -0.09), (0.042, 0.0), (0.028, 0.08), (0.0, 0.13)], palette.GLASS, axis="x", name="canopy"
    )
    wing = plane_parts.Wing(
        0.14, 0.35 * width, rng.uniform(0.09, 0.12), 0.035, rng.uniform(0.75, 1.05), 0.02, rng.uniform(0.01, 0.06), 0.13
    )
    return [
        plane_parts.fuselage(stations, body),
        canopy.scaled(1.0, 0.9, 0.85).moved(0.28, 0.025, 0),
        *parts.both_sides([plane_parts.wing_part(wing, body)]),
        *plane_parts.tail(rng, body, accent, 0.022, t_tail=rng.random() < 0.8, size=0.85),
    ]
