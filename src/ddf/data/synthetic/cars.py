"""Cars: hatchbacks, saloons, estates, vans, pick-ups and sports cars, facing +X, wheels on the ground, in metres."""

import itertools

import numpy as np
from jaxtyping import Float

from ddf.data.synthetic import car_parts, palette, parts
from ddf.data.synthetic.parts import Part, Real


def build(rng: np.random.Generator) -> list[Part]:
    """One car."""
    style = str(rng.choice(car_parts.STYLES, p=car_parts.STYLE_ODDS))
    car = car_parts.measures(rng, style)
    pieces = [body(car), *car_parts.wheels(rng, car), *car_parts.lamps(rng, car), *car_parts.bumpers(rng, car)]
    pieces += open_cabin(rng, car) if style == "convertible" else cabin(rng, car)
    if rng.random() < 0.85:
        pieces += car_parts.mirrors(car)
    if style == "pickup":
        pieces += car_parts.bed(car)
    if style in ("suv", "estate", "van") and rng.random() < 0.45:
        pieces += car_parts.roof_rails(car)
    if style == "sports" and rng.random() < 0.5:
        pieces += car_parts.spoiler(car)
    if style == "jeep" and rng.random() < 0.7:
        pieces += [part.moved(-car.length / 2 - 0.1, car.belt * 0.85, 0) for part in car_parts.spare(car)]
    return pieces


def body(car: car_parts.Car) -> Part:
    """The lower body: a loft along x whose lower edge rises over the wheels."""
    half = car.length / 2
    stations = [
        -half,
        -half + 0.03,
        -half + 0.12,
        half - 0.25,
        half - 0.1,
        half - 0.03,
        half,
        car.cowl,
        car.cowl + 0.08,
    ]
    stations += [car.tail, car.tail - 0.06] if car.tail > -0.9 * half else []
    arch = car.wheel * 1.18
    for axle in car.axles:
        stations += list(axle + arch * np.cos(np.linspace(0, np.pi, 11)))
    stations += list(np.linspace(-half + 0.2, half - 0.3, 9))
    sections = [_section(car, x, arch) for x in sorted(set(np.round(stations, 4))) if -half <= x <= half]
    return parts.loft(np.stack(sections), car.paint, name="body")


def _section(car: car_parts.Car, x: Real, arch: Real) -> Float[np.ndarray, "s 3"]:
    """The closed outline of the lower body at x, counter-clockwise seen from the front."""
    half = car.length / 2
    top = np.interp(
        x,
        [
            -half,
            -half + 0.12,
            min(car.tail, -half + 0.2) if car.tail < -0.9 * half else car.tail,
            car.cowl,
            half - 0.15,
            half,
        ],
        [
            car.deck * 0.9,
            car.deck,
            car.deck if car.tail > -0.9 * half else car.belt,
            car.belt,
            car.hood,
            car.hood * 0.82,
        ],
    )
    bottom = car.clearance
    for axle in car.axles:
        if abs(x - axle) < arch:
            bottom = max(bottom, car.wheel * 0.95 + np.sqrt(arch**2 - (x - axle) ** 2))
    ends = np.clip((half - abs(x)) / (0.16 * car.length), 0, 1)
    wide = car.width / 2 * (car.nose + (1 - car.nose) * np.sqrt(1 - (1 - ends) ** 2))
    bottom = min(bottom + 0.12 * (1 - np.sqrt(1 - (1 - min(ends * 3, 1)) ** 2)), top - 0.1)
    rise = top - bottom
    profile = np.array(
        [(0.9, 0.0), (0.985, 0.12), (1.0, 0.45), (0.985, 0.72), (0.93, 0.92), (0.85, 0.985), (0.5, 1.02), (0.0, 1.03)]
    )
    sharp = np.array(
        [(0.97, 0.0), (1.0, 0.03), (1.0, 0.5), (0.995, 0.8), (0.99, 0.97), (0.96, 1.0), (0.5, 1.0), (0.0, 1.0)]
    )
    profile = sharp + car.bulge * (profile - sharp)
    side = np.array([[bottom + t * rise, s * wide] for s, t in profile])
    loop = np.concatenate([side, side[-2::-1] * np.array([1.0, -1.0])])
    return np.concatenate([np.full((len(loop), 1), x), loop], axis=1)[::-1]


def _outline(x0: Real, x1: Real, wide: Real, y: Real) -> Float[np.ndarray, "s 3"]:
    """A rounded rectangle in the level y, counter-clockwise seen from above."""
    ring = parts.ring(32, x1 - x0, 2 * wide, 9.0)
    return np.stack([(x0 + x1) / 2 + ring[:, 0], np.full(len(ring), y), -ring[:, 1]], axis=1)


def cabin(rng: np.random.Generator, car: car_parts.Car) -> list[Part]:
    """The cabin's shell and its panes, single sheets a little outside of it."""
    levels = [(-0.08, 0.0), (0.5, 0.5), (0.9, 0.92), (0.97, 0.985), (1.0, 1.0)]
    rise = car.roof - car.belt
    sections = []
    for share, level in levels:
        shrink = 1.0 if share < 0.95 else (0.97 if share < 0.99 else 0.86)
        x0, x1 = car.cabin_corner(level, False), car.cabin_corner(level, True)
        middle, span = (x0 + x1) / 2, (x1 - x0) / 2 * shrink
        sections.append(_outline(middle - span, middle + span, car.cabin_half(level) * shrink, car.belt + share * rise))
    shell = parts.loft(np.stack(sections), car.paint, name="cabin")
    return [shell, *_panes(rng, car)]


def open_cabin(rng: np.random.Generator, car: car_parts.Car) -> list[Part]:
    """A convertible's windscreen in its frame, two rows of seats and the dark floor between them."""
    share = rng.uniform(0.75, 1.0)
    y0, y1 = car.belt - 0.02, car.belt + share * (car.roof - car.belt)
    x0, x1 = car.cowl, car.cowl - share * car.screen
    z0, z1 = car.cabin_half(0.0), car.cabin_half(share)
    glass = parts.grid(
        np.array([[[x0, y0, z0], [x1, y1, z1]], [[x0, y0, -z0], [x1, y1, -z1]]]), palette.GLASS, name="screen"
    )
    frame = parts.tube(
        [(x0, y0, z0), (x1, y1, z1), (x1, y1, -z1), (x0, y0, -z0)], 0.03, car.paint, sides=6, name="frame"
    )
    floor = parts.rectangle((car.tail + 0.05, car.cowl - 0.15), (-z0 * 0.9, z0 * 0.9), car.belt + 0.035)
    tub = parts.grid(np.stack([floor[[0, 3]], floor[[1, 2]]]), palette.BLACK, name="tub")
    leather = palette.cloth(rng)
    seats = []
    for x in (car.cowl - 1.0, car.cowl - 1.75):
        if x > car.tail + 0.2:
            rest = parts.box((x, car.belt + 0.18, 0.36), (0.16, 0.4, 0.5), leather, taper=(0.7, 0.8), name="seat")
            seats.append(rest.turned("z", 0.25, (x, car.belt, 0)))
    wheel = parts.tube(
        [(0, 0.16 * np.cos(t), 0.16 * np.sin(t)) for t in np.linspace(0, 2 * np.pi, 17)[:-1]],
        0.015,
        palette.BLACK,
        sides=6,
        closed=True,
    )
    wheel = wheel.turned("z", 0.4).moved(car.cowl - 0.45, car.belt + 0.14, 0.36)
    return [glass, frame, tub, *parts.both_sides(seats), wheel]


def _panes(rng: np.random.Generator, car: car_parts.Car) -> list[Part]:
    """Windscreen, rear window and side windows."""
    rise, low, high, out = car.roof - car.belt, 0.08, 0.86, 0.012
    panes = []
    for front in (True, False):
        sign = 1 if front else -1
        corners = []
        for z_sign in (sign, -sign):
            edge = []
            for share in (low, high):
                x = car.cabin_corner(share, front) + sign * out
                edge.append(
                    [
                        x,
                        car.belt + share * rise + (out if car.screen > 0.4 else 0),
                        z_sign * car.cabin_half(share) * 0.86,
                    ]
                )
            corners.append(edge)
        panes.append(parts.grid(np.array(corners), palette.GLASS, name="screen"))
    count = int(rng.integers(2, 4))
    cuts = np.linspace(0.07, 0.93, count + 1)
    for start, end in itertools.pairwise(cuts):
        corners = []
        for t in (start + 0.018, end - 0.018):
            edge = []
            for share in (low, high):
                x0, x1 = car.cabin_corner(share, False), car.cabin_corner(share, True)
                edge.append([x0 + t * (x1 - x0), car.belt + share * rise, car.cabin_half(share) + out])
            corners.append(edge)
        panes += parts.both_sides([parts.grid(np.array(corners), palette.GLASS, name="window")])
    return panes
