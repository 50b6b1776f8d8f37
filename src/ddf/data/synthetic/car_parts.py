"""What a car is made of: its measures, body, cabin, wheels, lamps and what hangs on it; facing +X, in metres."""

import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ddf.data.synthetic import palette, parts
from ddf.data.synthetic.parts import Paint, Part, Real

# Half of a body's outline from the sill to the middle of its top: shares of the width and of the height.
_ROUND = np.array([[0.9, 0.985, 1.0, 0.985, 0.93, 0.85, 0.5, 0.0], [0.0, 0.12, 0.45, 0.72, 0.92, 0.985, 1.02, 1.03]]).T
_SHARP = np.array([[0.97, 1.0, 1.0, 0.995, 0.99, 0.96, 0.5, 0.0], [0.0, 0.03, 0.5, 0.8, 0.97, 1.0, 1.0, 1.0]]).T
# A cabin's levels: share of the height, share of the screens' lean, factor of the width.
_CABIN = ((-0.08, 0.0, 1.0), (0.5, 0.5, 1.0), (0.9, 0.92, 1.0), (0.97, 0.985, 0.97), (1.0, 1.0, 0.86))


@dataclass(frozen=True)
class Car:
    """Measures of one car, metres; x runs from -length/2 (rear) to length/2, y from the ground.

    hood, belt, deck: heights of the bonnet's front, of the window line and of the boot; roof: height of the roof; cowl:
    x of the windscreen's foot; screen, rear_screen: how far the two screens lean over their height; tail: x of the rear
    screen's foot; clearance: of the sill; wheel: radius; axles: x of the rear and the front wheel; nose: width of the
    ends over that of the middle; bulge: of the sides, 0 for flat ones with sharp edges to 1.
    """

    length: Real
    width: Real
    hood: Real
    belt: Real
    deck: Real
    roof: Real
    cowl: Real
    screen: Real
    tail: Real
    rear_screen: Real
    clearance: Real
    wheel: Real
    axles: tuple[Real, Real]
    nose: Real
    bulge: Real
    paint: Paint

    def cabin_corner(self, share: Real, front: bool) -> Real:
        """x of the cabin's front or rear at a share of its height."""
        return self.cowl - share * self.screen if front else self.tail + share * self.rear_screen

    def cabin_half(self, share: Real) -> Real:
        """Half the cabin's width at a share of its height."""
        return self.width / 2 * (0.9 - 0.14 * share)


def body(car: Car) -> Part:
    """The lower body: a loft along x whose lower edge rises over the wheels."""
    half, arch = car.length / 2, car.wheel * 1.18
    stations = [-half, -half + 0.03, -half + 0.12, half - 0.25, half - 0.1, half - 0.03, half]
    stations += [car.cowl, car.cowl + 0.08]
    stations += [car.tail, car.tail - 0.06] if car.tail > -0.9 * half else []
    for axle in car.axles:
        stations += list(axle + arch * np.cos(np.linspace(0, np.pi, 11)))
    stations += list(np.linspace(-half + 0.2, half - 0.3, 9))
    sections = [_section(car, x, arch) for x in sorted(set(np.round(stations, 4))) if -half <= x <= half]
    return parts.loft(np.stack(sections), car.paint, name="body")


def _section(car: Car, x: Real, arch: Real) -> Float[np.ndarray, "s 3"]:
    """The closed outline of the lower body at x, counter-clockwise seen from the front."""
    half = car.length / 2
    booted = car.tail > -0.9 * half
    tail = min(car.tail, -half + 0.2) if car.tail < -0.9 * half else car.tail
    levels = [car.deck * 0.9, car.deck, car.deck if booted else car.belt, car.belt, car.hood, car.hood * 0.82]
    top = np.interp(x, [-half, -half + 0.12, tail, car.cowl, half - 0.15, half], levels)
    bottom = car.clearance
    for axle in car.axles:
        if abs(x - axle) < arch:
            bottom = max(bottom, car.wheel * 0.95 + np.sqrt(arch**2 - (x - axle) ** 2))
    ends = np.clip((half - abs(x)) / (0.16 * car.length), 0, 1)
    wide = car.width / 2 * (car.nose + (1 - car.nose) * np.sqrt(1 - (1 - ends) ** 2))
    bottom = min(bottom + 0.12 * (1 - np.sqrt(1 - (1 - min(ends * 3, 1)) ** 2)), top - 0.1)
    rise = top - bottom
    side = np.array([[bottom + t * rise, s * wide] for s, t in _SHARP + car.bulge * (_ROUND - _SHARP)])
    loop = np.concatenate([side, side[-2::-1] * np.array([1.0, -1.0])])
    return np.concatenate([np.full((len(loop), 1), x), loop], axis=1)[::-1]


def _outline(x0: Real, x1: Real, wide: Real, y: Real) -> Float[np.ndarray, "s 3"]:
    """A rounded rectangle in the level y, counter-clockwise seen from above."""
    ring = parts.ring(32, x1 - x0, 2 * wide, 9.0)
    return np.stack([(x0 + x1) / 2 + ring[:, 0], np.full(len(ring), y), -ring[:, 1]], axis=1)


def cabin(rng: np.random.Generator, car: Car) -> list[Part]:
    """The cabin's shell and its panes, single sheets a little outside of it."""
    rise, sections = car.roof - car.belt, []
    for share, level, shrink in _CABIN:
        x0, x1 = car.cabin_corner(level, False), car.cabin_corner(level, True)
        middle, span = (x0 + x1) / 2, (x1 - x0) / 2 * shrink
        sections.append(_outline(middle - span, middle + span, car.cabin_half(level) * shrink, car.belt + share * rise))
    shell = parts.loft(np.stack(sections), car.paint, name="cabin")
    return [shell, *_panes(rng, car)]


def _panes(rng: np.random.Generator, car: Car) -> list[Part]:
    """Windscreen, rear window and side windows."""
    rise, levels, out = car.roof - car.belt, (0.08, 0.86), 0.012
    raised, panes = out if car.screen > 0.4 else 0, []
    for sign in (1, -1):
        places = [
            (car.cabin_corner(share, sign > 0) + sign * out, car.belt + share * rise + raised) for share in levels
        ]
        halves = [car.cabin_half(share) * 0.86 for share in levels]
        sides = [[(x, y, z * half) for (x, y), half in zip(places, halves, strict=True)] for z in (sign, -sign)]
        panes.append(parts.grid(np.array(sides), palette.GLASS, name="screen"))
    cuts = np.linspace(0.07, 0.93, int(rng.integers(2, 4)) + 1)
    for start, end in itertools.pairwise(cuts):
        corners = []
        for t in (start + 0.018, end - 0.018):
            edge = []
            for share in levels:
                x0, x1 = car.cabin_corner(share, False), car.cabin_corner(share, True)
                edge.append([x0 + t * (x1 - x0), car.belt + share * rise, car.cabin_half(share) + out])
            corners.append(edge)
        panes += parts.both_sides([parts.grid(np.array(corners), palette.GLASS, name="window")])
    return panes


def open_cabin(rng: np.random.Generator, car: Car) -> list[Part]:
    """A convertible's windscreen in its frame, two rows of seats and the dark floor between them."""
    share = rng.uniform(0.75, 1.0)
    x0, y0, z0 = car.cowl, car.belt - 0.02, car.cabin_half(0.0)
    x1, y1, z1 = car.cowl - share * car.screen, car.belt + share * (car.roof - car.belt), car.cabin_half(share)
    left, right = [(x0, y0, z0), (x1, y1, z1)], [(x0, y0, -z0), (x1, y1, -z1)]
    glass = parts.grid(np.array([left, right]), palette.GLASS, name="screen")
    frame = parts.tube([*left, *right[::-1]], 0.03, car.paint, sides=6, name="frame")
    floor = parts.rectangle((car.tail + 0.05, car.cowl - 0.15), (-z0 * 0.9, z0 * 0.9), car.belt + 0.035)
    tub = parts.grid(np.stack([floor[[0, 3]], floor[[1, 2]]]), palette.BLACK, name="tub")
    leather, seats = palette.cloth(rng), []
    for x in (car.cowl - 1.0, car.cowl - 1.75):
        if x > car.tail + 0.2:
            rest = parts.box((x, car.belt + 0.18, 0.36), (0.16, 0.4, 0.5), leather, taper=(0.7, 0.8), name="seat")
            seats.append(rest.turned("z", 0.25, (x, car.belt, 0)))
    path = [(0, 0.16 * np.cos(t), 0.16 * np.sin(t)) for t in np.linspace(0, 2 * np.pi, 17)[:-1]]
    wheel = parts.tube(path, 0.015, palette.BLACK, sides=6, closed=True)
    wheel = wheel.turned("z", 0.4).moved(car.cowl - 0.45, car.belt + 0.14, 0.36)
    return [glass, frame, tub, *parts.both_sides(seats), wheel]


def wheels(rng: np.random.Generator, car: Car) -> list[Part]:
    """Four tyres with rims, half in the arches."""
    radius, wide = car.wheel, car.wheel * rng.uniform(0.28, 0.36)
    rim = radius * rng.uniform(0.55, 0.72)
    half_tyre = [(rim, wide), (radius * 0.94, wide), (radius, wide * 0.7)]
    tyre_profile = [*((r, -z) for r, z in half_tyre), *half_tyre[::-1]]
    tyre = parts.lathe(tyre_profile, palette.TYRE, sides=24, axis="z", name="tyre")
    hub_profile = [
        (0.0, -wide * 0.8), (rim, -wide * 0.8), (rim, wide * 0.75), (rim * 0.85, wide * 0.5), (rim * 0.25, wide * 0.6),
        (0, wide * 0.7),
    ]  # fmt: skip
    hub = parts.lathe(hub_profile, palette.CHROME, sides=16, axis="z", name="hub")
    spoke = parts.box((0, rim * 0.5, wide * 0.72), (rim * 0.16, rim * 0.8, wide * 0.2), palette.BLACK, name="spoke")
    count = int(rng.choice([5, 6, 7]))
    spokes = [spoke.turned("z", 2 * np.pi * k / count) for k in range(count)]
    z = car.width / 2 - wide * 0.85
    return parts.both_sides(part.moved(axle, radius, z) for axle in car.axles for part in [tyre, hub, *spokes])


def lamps(rng: np.random.Generator, car: Car) -> list[Part]:
    """Head and tail lamps, and a grille."""
    half, low = car.length / 2, car.clearance
    y = low + (car.hood * 0.84 - low) * 0.78
    wide, high = rng.uniform(0.28, 0.42), rng.uniform(0.1, 0.17)
    z = car.width / 2 * 0.84 - wide / 2
    head = parts.box((half - 0.045, y, z), (0.13, high, wide), palette.LAMP, name="lamp")
    place, size = (-half + 0.05, low + (car.deck - low) * 0.75, z + 0.04), (0.14, high * 1.3, wide * 0.7)
    rear = parts.box(place, size, palette.TAIL_LAMP, name="lamp")
    size = (0.03, rng.uniform(0.1, 0.2), car.width * rng.uniform(0.3, 0.45))
    return [*parts.both_sides([head, rear]), parts.box((half - 0.01, y - 0.03, 0), size, palette.BLACK, name="grille")]


def bumpers(rng: np.random.Generator, car: Car) -> list[Part]:
    """Bars across front and rear."""
    paint = car.paint if rng.random() < 0.5 else palette.BLACK
    high, half = rng.uniform(0.14, 0.22), car.length / 2
    y, size = car.clearance + 0.06 + high / 2, (0.16, high, car.width * 0.86)
    return [parts.box((x, y + up, 0), size, paint, name="bumper") for x, up in ((half - 0.03, 0), (-half + 0.03, 0.05))]


def mirrors(car: Car) -> list[Part]:
    """Door mirrors."""
    place = (car.cowl - 0.3 * car.screen, car.belt + 0.08, car.width / 2 + 0.06)
    return parts.both_sides([parts.box(place, (0.1, 0.13, 0.2), car.paint, taper=(0.8, 0.9), name="mirror")])


def bed(car: Car) -> list[Part]:
    """The open box of a pick-up: side walls above the deck, and its floor as a dark sheet."""
    x0, x1, wall, top, floor = -car.length / 2 + 0.06, car.tail - 0.05, 0.06, car.deck + 0.22, car.deck + 0.05
    y, high = (car.deck + top) / 2 - 0.1, top - car.deck + 0.2
    sides = parts.box(((x0 + x1) / 2, y, car.width / 2 * 0.92), (x1 - x0, high, wall), car.paint, name="wall")
    gate = parts.box((x0, y, 0), (wall, high, car.width * 0.92), car.paint, name="gate")
    sheet = np.array([[[x, floor, z] for z in (0.8, -0.8)] for x in (x0, x1)])
    return [*parts.both_sides([sides]), gate, parts.grid(sheet, palette.BLACK, name="floor")]


def roof_rails(car: Car) -> list[Part]:
    """Two rails along the roof."""
    z, low, high = car.cabin_half(1.0) * 0.86, car.roof - 0.02, car.roof + 0.06
    x0, x1 = car.cabin_corner(1.0, False) + 0.15, car.cabin_corner(1.0, True) - 0.15
    path = [(x0, low, z), (x0 + 0.08, high, z), (x1 - 0.08, high, z), (x1, low, z)]
    return parts.both_sides([parts.tube(path, 0.02, palette.CHROME, sides=6, name="rail")])


def spare(car: Car) -> list[Part]:
    """A spare wheel on the rear, its axis along X."""
    tyre = parts.lathe(parts.disc_profile(car.wheel * 0.95, 0.11, 0.04), palette.TYRE, sides=24, axis="x", name="spare")
    hub = parts.lathe(parts.disc_profile(car.wheel * 0.5, 0.13), palette.CHROME, axis="x", name="hub")
    return [part.moved(-car.length / 2 - 0.1, car.belt * 0.85, 0) for part in (tyre, hub)]


def spoiler(car: Car) -> list[Part]:
    """A blade over the boot on two posts."""
    x, y = -car.length / 2 + 0.18, car.deck + 0.2
    blade = parts.box((x, y, 0), (0.28, 0.03, car.width * 0.85), car.paint, name="spoiler")
    post = parts.box((x, car.deck + 0.08, car.width * 0.3), (0.12, 0.26, 0.03), car.paint, name="post")
    return [blade, *parts.both_sides([post])]


def racing_wing(rng: np.random.Generator, car: Car) -> list[Part]:
    """A blade over the tail between two posts or end plates."""
    x, y = -car.length / 2 + rng.uniform(0.0, 0.3), car.deck + rng.uniform(0.12, 0.4)
    chord, wide = rng.uniform(0.2, 0.45), car.width * rng.uniform(0.7, 0.95)
    blade = parts.box((x, y, 0), (chord, rng.uniform(0.02, 0.06), wide), car.paint, name="spoiler")
    z, foot = wide * float(rng.choice([0.25, 0.5])), 0.75 * car.deck
    post = parts.box((x + 0.1, (foot + y) / 2, z), (chord, y - foot + 0.06, 0.03), car.paint, name="post")
    return [blade.turned("z", rng.uniform(0, 0.2), (x, y, 0)), *parts.both_sides([post])]


def skirts(rng: np.random.Generator, car: Car) -> list[Part]:
    """A sill between the wheels, and a lip in front of them."""
    rear, front = car.axles
    low, high = 0.5 * car.clearance, car.clearance + 0.1
    y, tall = (low + high) / 2, high - low
    sill = (front - rear - 2.5 * car.wheel, tall, car.width * rng.uniform(0.96, 1.04))
    lip = car.length / 2 - front - 1.25 * car.wheel + rng.uniform(0.0, 0.12)
    boxes = (((front + rear) / 2, sill), (front + 1.25 * car.wheel + lip / 2, (lip, tall, car.width * 0.94)))
    return [parts.box((x, y, 0), size, car.paint, name="skirt") for x, size in boxes]


def cargo(rng: np.random.Generator, car: Car) -> Part:
    """A lorry's closed box behind the cab."""
    x0, x1 = -car.length / 2, car.tail - rng.uniform(0.0, 0.1)
    y0, y1 = 0.8 * car.deck, car.roof * rng.uniform(0.9, 1.25)
    size = (x1 - x0, y1 - y0, car.width * rng.uniform(0.95, 1.05))
    paint = car.paint if rng.random() < 0.5 else palette.car(rng)
    return parts.box(((x0 + x1) / 2, (y0 + y1) / 2, 0), size, paint, name="cargo")


def beacon(car: Car) -> Part:
    """The bar of lamps on the roof of a police car."""
    middle = (car.cabin_corner(1.0, True) + car.cabin_corner(1.0, False)) / 2
    return parts.box((middle, car.roof + 0.04, 0), (0.25, 0.14, 1.1), palette.TAIL_LAMP, name="beacon")
