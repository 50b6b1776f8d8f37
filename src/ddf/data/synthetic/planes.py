"""Aeroplanes, nose to +X, wings along Z, in fuselage lengths: `build` in eight styles, `build_wide` of any layout."""

import numpy as np

from ddf.data.synthetic import palette, parts, plane_parts
from ddf.data.synthetic.parts import Paint, Part, both_sides
from ddf.data.synthetic.plane_parts import Wing

NARROW_SHARE = 0.2  # of the wide ones: as `build` makes them, stretched
STRETCH = (0.85, 1.18)  # across and up


def build(rng: np.random.Generator) -> list[Part]:
    """One aeroplane."""
    style = str(rng.choice(list(STYLES), p=[share for share, _ in STYLES.values()]))
    return STYLES[style][1](rng, *palette.plane(rng), style)


def build_wide(rng: np.random.Generator) -> list[Part]:
    """One aeroplane of more layouts: any wing on any fuselage, engines in several places, V-tails."""
    if rng.random() < NARROW_SHARE:
        up, across = rng.uniform(*STRETCH, 2)
        return [part.scaled(1.0, up, across) for part in build(rng)]
    style = str(rng.choice(list(WIDE_STYLES), p=[share for share, _ in WIDE_STYLES.values()]))
    return WIDE_STYLES[style][1](rng, *palette.plane(rng), style)


def _airliner(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """Swept low wing, two or four engines under it (or two at the tail)."""
    width = rng.uniform(0.085, 0.125)
    fuselage, height = plane_parts.tube_body(rng, body, width)
    root = rng.uniform(0.17, 0.24)
    wing = Wing(
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
    pieces = [fuselage, *both_sides([plane_parts.wing_part(wing, body, sheet=rng.random() < 0.15)])]
    pieces += plane_parts.windows(rng, width, height, 0.36, -0.2) if rng.random() < 0.7 else []
    pieces += plane_parts.cockpit(width, height)
    engine = rng.uniform(0.026, 0.037)
    length = engine * rng.uniform(3.2, 4.4)
    if at_tail:
        pieces += both_sides(plane_parts.tail_engines(body, width, height, engine * 0.85, length))
    else:
        shares = [0.33] if rng.random() < 0.68 else [0.27, 0.52]
        for share in shares:
            radius, long = (size * (1.0 if len(shares) == 1 else 0.8) for size in (engine, length))
            paint = accent if rng.random() < 0.3 else body
            pieces += both_sides(plane_parts.engine_pod(wing, share, radius, long, radius * 1.25, paint))
    if rng.random() < 0.45:
        pieces += both_sides([plane_parts.winglet(wing, accent)])
    if rng.random() < 0.3:
        pieces += plane_parts.gear(wing, width, height, body)
    if third:
        pieces += [part.moved(-0.28, 0.5 * height, 0) for part in plane_parts.nacelle(engine * 0.85, 0.2, accent)]
    return pieces + plane_parts.tail(rng, body, accent, 0.32 * height, t_tail=at_tail)


def _business(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """Engines at the tail, T-tail, wing further back."""
    width = rng.uniform(0.11, 0.15)
    fuselage, height = plane_parts.tube_body(rng, body, width)
    root = rng.uniform(0.2, 0.26)
    wing = Wing(
        x=rng.uniform(0.04, 0.1),
        y=-0.38 * height,
        root=root,
        tip=root * rng.uniform(0.25, 0.45),
        span=rng.uniform(0.38, 0.5),
        sweep=rng.uniform(0.08, 0.22),
        rise=rng.uniform(0.01, 0.05),
        thickness=0.1,
    )
    radius = rng.uniform(0.03, 0.04)
    pieces = [fuselage, *both_sides([plane_parts.wing_part(wing, body)]), *plane_parts.cockpit(width, height)]
    pieces += plane_parts.windows(rng, width, height, 0.28, -0.08)
    pieces += both_sides(plane_parts.tail_engines(accent, width * 0.8, height, radius, radius * 4.2))
    if rng.random() < 0.6:
        pieces += both_sides([plane_parts.winglet(wing, accent)])
    return pieces + plane_parts.tail(rng, body, accent, 0.36 * height, t_tail=rng.random() < 0.85, size=1.1)


def _propeller_plane(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """A light aircraft: straight high or low wing (or both), one propeller, fixed wheels."""
    width, height = rng.uniform(0.12, 0.16), rng.uniform(0.14, 0.19)
    stations = [
        (-0.5, 0.04, width * 0.12, height * 0.2), (-0.3, 0.025, width * 0.45, height * 0.45),
        (-0.05, 0.01, width * 0.9, height * 0.9), (0.12, 0.01, width, height),
        (0.3, -0.01, width * 0.9, height * 0.78), (0.45, -0.01, width * 0.62, height * 0.55),
    ]  # fmt: skip
    pieces = [plane_parts.fuselage(stations, body, power=2.6)]
    canopy = plane_parts.turned("canopy", [(0.0, -0.14), (0.042, -0.1), (0.062, 0.0), (0.05, 0.07), (0.0, 0.12)])
    pieces.append(canopy.scaled(1.0, 1.1, 0.85 * width / 0.12).moved(0.1, height * 0.44, 0))
    pieces += plane_parts.propeller(rng, rng.uniform(0.11, 0.15), 0.455)
    root = rng.uniform(0.14, 0.2)
    layout = str(rng.choice(["high", "low", "biplane"], p=[0.4, 0.42, 0.18]))
    levels = {"high": [0.46 * height + 0.02], "low": [-0.38 * height], "biplane": [-0.36 * height, 0.75 * height]}
    span = rng.uniform(0.48, 0.62)
    for level in levels[layout]:
        tip, sweep, rise = root * rng.uniform(0.55, 1.0), rng.uniform(0.0, 0.05), rng.uniform(0.0, 0.05)
        wing = Wing(0.22, level, root, tip, span, sweep, rise, 0.13)
        pieces += both_sides([plane_parts.wing_part(wing, accent if rng.random() < 0.5 else body)])
    if layout != "low":
        far = 0.55 * span
        foot = (0.16, -0.36 * height, 0.08 if layout == "high" else far)
        pieces += both_sides([parts.beam((0.16, levels[layout][-1], far), foot, 0.01, body, name="strut")])
    for x, z in ((0.2, 0.1), (0.2, -0.1), (0.38 if rng.random() < 0.6 else -0.44, 0.0)):
        y, radius, top = (-height * 0.5 - 0.05, 0.03, -0.02) if x > 0 else (-0.02, 0.018, 0.03)
        pieces += plane_parts.wheel(x, y, z, radius, top, body)
    if rng.random() < 0.15:
        pieces += plane_parts.floats(height, accent)
    return pieces + plane_parts.tail(rng, body, accent, 0.05, t_tail=False, size=1.05)


def _twin(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """A turboprop transport: straight wing, two or four propellers."""
    width = rng.uniform(0.11, 0.14)
    fuselage, height = plane_parts.tube_body(rng, body, width)
    high, root = rng.random() < 0.6, rng.uniform(0.13, 0.17)
    wing = Wing(
        x=rng.uniform(0.08, 0.14),
        y=(0.46 if high else -0.36) * height,
        root=root,
        tip=root * rng.uniform(0.4, 0.7),
        span=rng.uniform(0.48, 0.6),
        sweep=rng.uniform(0.01, 0.06),
        rise=0.0 if high else 0.04,
        thickness=0.14,
    )
    pieces = [fuselage, *both_sides([plane_parts.wing_part(wing, body)]), *plane_parts.cockpit(width, height)]
    pieces += plane_parts.windows(rng, width, height, 0.33, -0.18)
    profile = [(0.0, -0.2), (0.02, -0.15), (0.034, -0.06), (0.032, 0.03), (0.022, 0.075)]
    pod = plane_parts.turned("pod", profile, accent)
    for share in [0.32] if rng.random() < 0.75 else [0.28, 0.52]:
        blades = plane_parts.propeller(rng, rng.uniform(0.09, 0.115), 0.08)
        pieces += both_sides(part.moved(*wing.leading(share)) for part in [pod, *blades])
    return pieces + plane_parts.tail(rng, body, accent, 0.34 * height, t_tail=rng.random() < 0.5)


def _fighter(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """A jet with a pointed nose, canopy, swept or delta wing, one or two fins, one or two nozzles."""
    width, height = rng.uniform(0.11, 0.17), rng.uniform(0.09, 0.12)
    stations = [
        (-0.46, 0, width * 0.8, height * 0.75), (-0.3, 0, width, height * 0.9), (-0.05, 0, width, height),
        (0.15, 0.005, width * 0.75, height), (0.3, 0.0, width * 0.45, height * 0.75),
        (0.42, -0.01, width * 0.22, height * 0.4), (0.54, -0.015, 0.004, 0.004),
    ]  # fmt: skip
    canopy = plane_parts.turned("canopy", [(0.0, -0.13), (0.025, -0.08), (0.034, 0.0), (0.02, 0.07), (0.0, 0.11)])
    pieces = [
        plane_parts.fuselage(stations, body, power=2.8),
        canopy.scaled(1.0, 1.2, 0.8).moved(0.2, height * 0.42, 0),
    ]
    delta = style == "delta"
    root = rng.uniform(0.42, 0.55) if delta else rng.uniform(0.26, 0.34)
    span = rng.uniform(0.26, 0.36)
    wing = Wing(
        x=-0.42 + root,
        y=rng.uniform(-0.2, 0.2) * height,
        root=root,
        tip=root * (rng.uniform(0.02, 0.12) if delta else rng.uniform(0.2, 0.4)),
        span=span,
        sweep=root * rng.uniform(0.8, 0.92) if delta else rng.uniform(0.14, 0.24),
        rise=rng.uniform(-0.02, 0.01),
        thickness=0.05,
    )
    pieces += both_sides([plane_parts.wing_part(wing, body, sheet=rng.random() < 0.2)])
    nozzles = [0.0] if rng.random() < 0.5 else [-width * 0.24, width * 0.24]
    radius = height * (0.42 if len(nozzles) == 1 else 0.34)
    nozzle = plane_parts.turned("nozzle", [(radius * 0.75, -0.1), (radius, 0.0), (radius, 0.06)], palette.BLACK)
    pieces += [nozzle.moved(-0.45, 0, z) for z in nozzles]
    place, size = (0.02, -0.1 * height, width * 0.52), (0.2, height * 0.62, width * 0.2)
    pieces += both_sides([parts.box(place, size, body, name="intake")])
    blade = Wing(-0.22, 0.0, 0.18, 0.08, rng.uniform(0.13, 0.18), rng.uniform(0.1, 0.16), 0.0, 0.06)
    fin = plane_parts.fin_part(blade, accent)
    if rng.random() < 0.5:
        pieces.append(fin.moved(-0.02, height * 0.38, 0))
    else:
        pieces += both_sides([fin.turned("x", rng.uniform(0.1, 0.35)).moved(-0.02, height * 0.3, width * 0.36)])
    if not delta or rng.random() < 0.3:
        small = Wing(0.22 if delta else -0.36, 0.0, 0.12, 0.05, rng.uniform(0.15, 0.2), 0.08, 0.0, 0.06)
        pieces += both_sides([plane_parts.wing_part(small, body, stations=3, name="tailplane")])
    if rng.random() < 0.5:
        profile = [(0.0, -0.09), (0.01, -0.085), (0.01, 0.06), (0.0, 0.1)]
        missile = plane_parts.turned("missile", profile, palette.hsv(0, 0, 0.85), sides=8)
        x, y, z = wing.leading(0.55)
        pieces += both_sides([missile.moved(x - 0.06, y - 0.022, z)])
    return pieces


def _supersonic(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """A slender airliner with an ogival delta wing, four engine boxes under it, and no tail plane."""
    width, droop = rng.uniform(0.05, 0.065), rng.uniform(0.0, 0.02)
    stations = [
        (-0.5, 0.012, 0.006, 0.008), (-0.36, 0.006, width * 0.7, width * 0.75), (-0.15, 0, width, width * 1.1),
        (0.25, 0, width, width * 1.1), (0.4, -0.2 * droop, width * 0.7, width * 0.75), (0.5, -droop, 0.004, 0.004),
    ]  # fmt: skip
    span = rng.uniform(0.2, 0.26)
    inner = Wing(0.2, -0.3 * width, 0.58, 0.36, span * 0.45, 0.24, 0.0, 0.025)
    x, y, _ = inner.leading(1.0)
    outer = Wing(x, y, 0.36, 0.06, span * 0.55, 0.25, -0.006, 0.025)
    places = [(-0.27, -0.3 * width - 0.022, span * share) for share in (0.35, 0.55)]
    pods = [parts.box(place, (0.2, 0.03, 0.04), accent, name="engine") for place in places]
    fin = Wing(-0.2, 0.0, 0.22, 0.07, rng.uniform(0.09, 0.12), 0.14, 0.0, 0.05)
    wings = [plane_parts.wing_part(inner, body), plane_parts.wing_part(outer, body).moved(0, 0, span * 0.45 - 0.001)]
    fin_part = plane_parts.fin_part(fin, accent).moved(-0.03, width * 0.4, 0)
    return [plane_parts.fuselage(stations, body), *both_sides([*wings, *pods]), fin_part]


def _glider(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """A sailplane: very long wing, thin tail boom, glass nose."""
    width = rng.uniform(0.075, 0.095)
    stations = [
        (-0.5, 0.02, 0.012, 0.014), (-0.2, 0.015, width * 0.3, width * 0.34), (0.05, 0.0, width * 0.85, width * 1.0),
        (0.25, -0.01, width, width * 1.15), (0.42, -0.015, width * 0.6, width * 0.7), (0.5, -0.02, 0.006, 0.006),
    ]  # fmt: skip
    profile = [(0.0, -0.14), (0.03, -0.09), (0.042, 0.0), (0.028, 0.08), (0.0, 0.13)]
    canopy = plane_parts.turned("canopy", profile, sides=16)
    root, span, rise = rng.uniform(0.09, 0.12), rng.uniform(0.75, 1.05), rng.uniform(0.01, 0.06)
    wing = Wing(0.14, 0.35 * width, root, 0.035, span, 0.02, rise, 0.13)
    return [
        plane_parts.fuselage(stations, body),
        canopy.scaled(1.0, 0.9, 0.85).moved(0.28, 0.025, 0),
        *both_sides([plane_parts.wing_part(wing, body)]),
        *plane_parts.tail(rng, body, accent, 0.022, t_tail=rng.random() < 0.8, size=0.85),
    ]


def _transport(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """Jets under the wing or at the tail, or propellers before it."""
    span, high_wing, t_tail = {
        "jetliner": ((0.08, 0.13), 0.1, 0.03),
        "tailjet": ((0.07, 0.14), 0.0, 0.95),
        "commuter": ((0.085, 0.15), 0.4, 0.35),
    }[style]
    width = rng.uniform(*span)
    fuselage, height = plane_parts.tube_body(rng, body, width)
    straight, at_tail = style == "commuter", style == "tailjet"
    above = rng.random() < high_wing
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
    main = plane_parts.kinked_wing(wing, kink, body)
    pieces = [fuselage, *both_sides([main]), *plane_parts.cockpit(width, height)]
    pieces += plane_parts.windows(rng, width, height, 0.34, -0.2) if rng.random() < 0.6 else []
    paint = accent if rng.random() < 0.3 else body
    radius = rng.uniform(0.024, 0.042)
    if at_tail:
        length = radius * rng.uniform(3.2, 5.5)
        pieces += both_sides(plane_parts.tail_engines(paint, width * 0.85, height, radius, length))
    else:
        four = rng.random() < 0.15
        for share in (0.28, 0.52) if four else (rng.uniform(0.28, 0.38),):
            if straight:
                pieces += both_sides(plane_parts.propeller_pod(rng, wing, share, radius * 0.9, paint))
            else:
                size = radius * (0.85 if four else 1.0)
                length = size * rng.uniform(3, 4.5)
                pieces += both_sides(plane_parts.engine_pod(wing, share, size, length, size * 1.25, paint))
    if rng.random() < (0.15 if straight else 0.4):
        pieces += both_sides([plane_parts.winglet(wing, accent)])
    if rng.random() < 0.25:
        pieces += plane_parts.gear(wing, width, height, body)
    return pieces + plane_parts.wide_tail(rng, body, accent, 0.32 * height, t_tail=rng.random() < t_tail)


def _light(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """One propeller in the nose, a cabin under a high wing or a canopy over a low one, or two wings."""
    width, height = rng.uniform(0.1, 0.17), rng.uniform(0.12, 0.19)
    nose, biplane = rng.uniform(0.45, 0.95), style == "biplane"
    stations = [
        (-0.5, 0.03, width * 0.12, height * 0.2), (-0.28, 0.02, width * rng.uniform(0.35, 0.6), height * 0.5),
        (-0.02, 0.01, width * 0.9, height * 0.9), (0.12, 0.01, width, height),
        (0.3, -0.01, width * 0.95, height * rng.uniform(0.65, 0.9)), (0.45, -0.015, width * nose, height * 0.8 * nose),
    ]  # fmt: skip
    pieces = [plane_parts.fuselage(stations, body, power=rng.uniform(2.0, 3.2))]
    levels = [-0.4 * height, 0.9 * height] if biplane else [rng.choice([-0.4, 0.5]) * height]
    high = levels[-1] > 0
    if high and not biplane:
        size = (0.3, 0.4 * height, 0.85 * width)
        pieces.append(parts.box((0.08, 0.35 * height, 0), size, palette.GLASS, taper=(0.7, 0.9)))
    else:
        pieces.append(plane_parts.canopy(width, height).moved(rng.uniform(0.0, 0.1), 0.42 * height, 0))
    pieces += plane_parts.propeller(rng, rng.uniform(0.11, 0.17), 0.455)
    root, span = rng.uniform(0.14, 0.24), rng.uniform(0.4, 0.6) if biplane else rng.uniform(0.45, 0.8)
    taper, round_tip = rng.uniform(0.5, 1.0), rng.random() < 0.45
    x, rise = rng.uniform(0.18, 0.28), rng.uniform(0.0, 0.02 if high else 0.08)
    make = plane_parts.rounded_wing if round_tip else plane_parts.wing_part
    for k, level in enumerate(levels):
        wing = Wing(x + 0.04 * k, level, root, root * taper, span, rng.uniform(0.0, 0.06), rise, 0.13)
        pieces += both_sides([make(wing, accent if rng.random() < 0.4 else body)])
    if high and rng.random() < (1.0 if biplane else 0.6):
        foot, lift = (0.6 * span, 0.6 * rise) if biplane else (0.25 * width, 0.0)
        lower, upper = (x - 0.08, -0.4 * height + lift, foot), (x - 0.08, levels[-1] + 0.6 * rise, 0.6 * span)
        pieces += both_sides([parts.beam(upper, lower, 0.01, body, name="strut")])
        if biplane:
            ends = [(x - 0.06, share * height, 0.3 * width) for share in (0.9, 0.3)]
            pieces += both_sides([parts.beam(ends[0], ends[1], 0.01, body)])
    if rng.random() < 0.75:
        ground = -0.5 * height - rng.uniform(0.03, 0.08)
        for place, z in ((0.2, 0.11), (0.2, -0.11), (0.38 if rng.random() < 0.5 else -0.44, 0.0)):
            y, radius, top = (-0.03, 0.018, 0.03) if place < 0 else (ground, 0.03, -0.2 * height)
            pieces += plane_parts.wheel(place, y, z, radius, top, body)
    return pieces + plane_parts.wide_tail(rng, body, accent, 0.05, t_tail=rng.random() < 0.08)


def _sailplane(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """A glider, or a model of one: slender pod, thin boom, long wing of two panels, any tail."""
    width, boom, lift = rng.uniform(0.04, 0.1), rng.uniform(0.12, 0.35), rng.uniform(0.0, 0.03)
    stations = [
        (-0.5, lift, width * 0.14, width * 0.16), (-0.15, 0.7 * lift, width * boom, width * boom),
        (0.1, 0.0, width * 0.8, width), (0.3, -0.01, width, width * 1.15),
        (0.44, -0.015, width * 0.6, width * 0.7), (0.5, -0.02, 0.006, 0.006),
    ]  # fmt: skip
    root, span = rng.uniform(0.09, 0.2), rng.uniform(0.6, 1.15)
    tip, rise, bent = root * rng.uniform(0.3, 0.7), rng.uniform(0.0, 0.08), rng.uniform(0.0, 0.12)
    x, y, share = rng.uniform(0.08, 0.24), rng.uniform(-0.1, 0.45) * width, rng.uniform(0.4, 0.7)
    lines = [
        (x, y, 0.0, root),
        (x - 0.01, y + share * rise, share * span, root * 0.92),
        (x - 0.03, y + rise + (1 - share) * bent, span, tip),
    ]
    wing = plane_parts.panels(lines, 0.11, accent if rng.random() < 0.3 else body)
    pieces = [plane_parts.fuselage(stations, body), *both_sides([wing])]
    if rng.random() < 0.6:
        pieces.append(plane_parts.canopy(width * 0.8, width).moved(0.28, 0.3 * width, 0))
    t_tail, size = rng.random() < 0.45, rng.uniform(0.65, 1.1)
    return pieces + plane_parts.wide_tail(rng, body, accent, lift, t_tail=t_tail, size=size, vee=0.25)


def _wide_fighter(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """A jet of other proportions."""
    wide, up = rng.uniform(0.8, 1.5), rng.uniform(0.75, 1.3)
    return [part.scaled(1.0, up, wide) for part in _fighter(rng, body, accent, str(rng.choice(["fighter", "delta"])))]


def _tailless(rng: np.random.Generator, body: Paint, accent: Paint, style: str) -> list[Part]:
    """A swept or round flying wing with a short pod and fins at its tips or in the middle."""
    root, span, sweep = rng.uniform(0.3, 0.8), rng.uniform(0.5, 1.0), rng.uniform(0.1, 0.5)
    wing = Wing(0.3, 0.0, root, root * rng.uniform(0.3, 0.7), span, sweep, rng.uniform(0.0, 0.04), 0.09)
    long, width = rng.uniform(0.6, 1.0) * root, rng.uniform(0.08, 0.16)
    stations = [
        (0.28 - long, 0.0, 0.01, 0.01), (0.3 - 0.6 * long, 0.01, width, width * 0.7), (0.32, 0.01, width, width * 0.7),
        (0.45, 0.0, 0.01, 0.01),
    ]  # fmt: skip
    fin = plane_parts.fin_part(Wing(0.0, 0.0, 0.14, 0.08, rng.uniform(0.08, 0.16), 0.08, 0.0, 0.08), accent)
    fins = both_sides([fin.moved(*(wing.leading(1.0) + np.array([0.14 - wing.tip, -0.01, -0.01])))])
    if rng.random() < 0.4 and root > 0.45:
        fins = [fin.moved(0.42 - root, 0.0, 0.0)]
    make = plane_parts.rounded_wing if rng.random() < 0.4 else plane_parts.wing_part
    return [plane_parts.fuselage(stations, accent), *both_sides([make(wing, body)]), *fins]


# Share and builder of each style.
STYLES = {
    "airliner": (0.35, _airliner),
    "business": (0.12, _business),
    "propeller": (0.15, _propeller_plane),
    "twin": (0.1, _twin),
    "fighter": (0.13, _fighter),
    "delta": (0.08, _fighter),
    "supersonic": (0.04, _supersonic),
    "glider": (0.03, _glider),
}
WIDE_STYLES = {
    "jetliner": (0.26, _transport),
    "tailjet": (0.16, _transport),
    "commuter": (0.17, _transport),
    "light": (0.15, _light),
    "biplane": (0.03, _light),
    "sailplane": (0.12, _sailplane),
    "fighter": (0.08, _wide_fighter),
    "tailless": (0.03, _tailless),
}
