"""Cars: hatchbacks, saloons, estates, vans, pick-ups and sports cars, facing +X, wheels on the ground, in metres."""

import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ddf.data.synthetic import palette, parts
from ddf.data.synthetic.parts import Paint, Part, Real

STYLES = ("hatchback", "saloon", "estate", "suv", "jeep", "van", "pickup", "sports", "convertible")
STYLE_ODDS = (0.18, 0.24, 0.1, 0.13, 0.05, 0.09, 0.08, 0.08, 0.05)


@dataclass(frozen=True)
class _Car:
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


def _measures(rng: np.random.Generator, style: str) -> _Car:
    """Proportions of a style, with variation."""
    length, width, roof = {
        "hatchback": (3.9, 1.7, 1.48),
        "saloon": (4.7, 1.8, 1.43),
        "estate": (4.7, 1.8, 1.48),
        "suv": (4.6, 1.88, 1.75),
        "jeep": (4.0, 1.75, 1.85),
        "convertible": (4.3, 1.78, 1.32),
        "van": (4.9, 1.9, 2.05),
        "pickup": (5.2, 1.9, 1.75),
        "sports": (4.3, 1.85, 1.2),
    }[style]
    length, width, roof = (value * rng.uniform(0.94, 1.06) for value in (length, width, roof))
    wheel = {"suv": 0.38, "jeep": 0.4, "pickup": 0.39, "van": 0.35}.get(style, 0.32) * rng.uniform(0.94, 1.1)
    half = length / 2
    belt = (0.62 if style != "van" else 0.55) * roof * rng.uniform(0.96, 1.04)
    hood = belt * (0.97 if style == "jeep" else rng.uniform(0.74, 0.92))
    cowl = {"van": 0.62, "sports": 0.22, "hatchback": 0.42, "pickup": 0.34}.get(style, 0.36) * half
    tail = {"saloon": rng.uniform(-0.7, -0.56), "sports": -0.66, "pickup": -0.12, "convertible": -0.55}.get(
        style, -0.985
    ) * half
    deck = belt * {"saloon": rng.uniform(0.93, 1.0), "sports": 0.95, "pickup": 0.98, "convertible": 0.97}.get(
        style, 1.0
    )
    return _Car(
        length=length,
        width=width,
        hood=hood,
        belt=belt,
        deck=deck,
        roof=roof,
        cowl=cowl + rng.uniform(-0.05, 0.05),
        screen=(roof - belt) * rng.uniform(0.95, 1.5) * {"van": 0.75, "jeep": 0.25}.get(style, 1.0),
        tail=tail,
        rear_screen=(roof - belt)
        * {"saloon": 1.3, "sports": 1.7, "hatchback": 0.6, "estate": 0.4}.get(style, 0.18)
        * rng.uniform(0.8, 1.2),
        clearance=wheel * rng.uniform(0.5, 0.75),
        wheel=wheel,
        axles=(-half + rng.uniform(0.17, 0.21) * length, half - rng.uniform(0.165, 0.2) * length),
        nose=0.6 if style == "jeep" else rng.uniform(0.76, 0.9),
        bulge=rng.uniform(0.25, 0.5) if style in ("jeep", "van") else rng.uniform(0.55, 1.0),
        paint=palette.car(rng),
    )


def build(rng: np.random.Generator) -> list[Part]:
    """One car."""
    style = str(rng.choice(STYLES, p=STYLE_ODDS))
    car = _measures(rng, style)
    pieces = [_body(car), *_wheels(rng, car), *_lamps(rng, car), *_bumpers(rng, car)]
    pieces += _open_cabin(rng, car) if style == "convertible" else _cabin(rng, car)
    if rng.random() < 0.85:
        pieces += _mirrors(car)
    if style == "pickup":
        pieces += _bed(car)
    if style in ("suv", "estate", "van") and rng.random() < 0.45:
        pieces += _roof_rails(car)
    if style == "sports" and rng.random() < 0.5:
        pieces += _spoiler(car)
    if style == "jeep" and rng.random() < 0.7:
        pieces += [part.moved(-car.length / 2 - 0.1, car.belt * 0.85, 0) for part in _spare(car)]
    return pieces


def _body(car: _Car) -> Part:
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


def _section(car: _Car, x: Real, arch: Real) -> Float[np.ndarray, "s 3"]:
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


def _cabin_corner(car: _Car, share: Real, front: bool) -> Real:
    """x of the cabin's front or rear at a share of its height."""
    return car.cowl - share * car.screen if front else car.tail + share * car.rear_screen


def _cabin_half(car: _Car, share: Real) -> Real:
    """Half the cabin's width at a share of its height."""
    return car.width / 2 * (0.9 - 0.14 * share)


def _cabin(rng: np.random.Generator, car: _Car) -> list[Part]:
    """The cabin's shell and its panes, single sheets a little outside of it."""
    levels = [(-0.08, 0.0), (0.5, 0.5), (0.9, 0.92), (0.97, 0.985), (1.0, 1.0)]
    rise = car.roof - car.belt
    sections = []
    for share, level in levels:
        shrink = 1.0 if share < 0.95 else (0.97 if share < 0.99 else 0.86)
        x0, x1 = _cabin_corner(car, level, False), _cabin_corner(car, level, True)
        middle, span = (x0 + x1) / 2, (x1 - x0) / 2 * shrink
        sections.append(
            _outline(middle - span, middle + span, _cabin_half(car, level) * shrink, car.belt + share * rise)
        )
    shell = parts.loft(np.stack(sections), car.paint, name="cabin")
    return [shell, *_panes(rng, car)]


def _open_cabin(rng: np.random.Generator, car: _Car) -> list[Part]:
    """A convertible's windscreen in its frame, two rows of seats and the dark floor between them."""
    share = rng.uniform(0.75, 1.0)
    y0, y1 = car.belt - 0.02, car.belt + share * (car.roof - car.belt)
    x0, x1 = car.cowl, car.cowl - share * car.screen
    z0, z1 = _cabin_half(car, 0.0), _cabin_half(car, share)
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


def _panes(rng: np.random.Generator, car: _Car) -> list[Part]:
    """Windscreen, rear window and side windows."""
    rise, low, high, out = car.roof - car.belt, 0.08, 0.86, 0.012
    panes = []
    for front in (True, False):
        sign = 1 if front else -1
        corners = []
        for z_sign in (sign, -sign):
            edge = []
            for share in (low, high):
                x = _cabin_corner(car, share, front) + sign * out
                edge.append(
                    [
                        x,
                        car.belt + share * rise + (out if car.screen > 0.4 else 0),
                        z_sign * _cabin_half(car, share) * 0.86,
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
                x0, x1 = _cabin_corner(car, share, False), _cabin_corner(car, share, True)
                edge.append([x0 + t * (x1 - x0), car.belt + share * rise, _cabin_half(car, share) + out])
            corners.append(edge)
        panes += parts.both_sides([parts.grid(np.array(corners), palette.GLASS, name="window")])
    return panes


def _wheels(rng: np.random.Generator, car: _Car) -> list[Part]:
    """Four tyres with rims, half in the arches."""
    wide = car.wheel * rng.uniform(0.28, 0.36)
    rim = car.wheel * rng.uniform(0.55, 0.72)
    tyre_profile = [
        (rim, -wide),
        (car.wheel * 0.94, -wide),
        (car.wheel, -wide * 0.7),
        (car.wheel, wide * 0.7),
        (car.wheel * 0.94, wide),
        (rim, wide),
    ]
    tyre = parts.lathe(tyre_profile, palette.TYRE, sides=24, axis="z", name="tyre")
    hub = parts.lathe(
        [
            (0.0, -wide * 0.8),
            (rim, -wide * 0.8),
            (rim, wide * 0.75),
            (rim * 0.85, wide * 0.5),
            (rim * 0.25, wide * 0.6),
            (0, wide * 0.7),
        ],
        palette.CHROME,
        sides=16,
        axis="z",
        name="hub",
    )
    spokes = []
    count = int(rng.choice([5, 6, 7]))
    for k in range(count):
        spoke = parts.box((0, rim * 0.5, wide * 0.72), (rim * 0.16, rim * 0.8, wide * 0.2), palette.BLACK, name="spoke")
        spokes.append(spoke.turned("z", 2 * np.pi * k / count))
    z = car.width / 2 - wide * 0.85
    wheels = []
    for axle in car.axles:
        wheels += [part.moved(axle, car.wheel, z) for part in [tyre, hub, *spokes]]
    return parts.both_sides(wheels)


def _lamps(rng: np.random.Generator, car: _Car) -> list[Part]:
    """Head and tail lamps, a grille and number plates."""
    half, low = car.length / 2, car.clearance
    y = low + (car.hood * 0.84 - low) * 0.78
    wide, high = rng.uniform(0.28, 0.42), rng.uniform(0.1, 0.17)
    z = car.width / 2 * 0.84 - wide / 2
    head = parts.box((half - 0.045, y, z), (0.13, high, wide), palette.LAMP, name="lamp")
    rear = parts.box(
        (-half + 0.05, low + (car.deck - low) * 0.75, z + 0.04),
        (0.14, high * 1.3, wide * 0.7),
        palette.TAIL_LAMP,
        name="lamp",
    )
    grille = parts.box(
        (half - 0.01, y - 0.03, 0),
        (0.03, rng.uniform(0.1, 0.2), car.width * rng.uniform(0.3, 0.45)),
        palette.BLACK,
        name="grille",
    )
    return [*parts.both_sides([head, rear]), grille]


def _bumpers(rng: np.random.Generator, car: _Car) -> list[Part]:
    """Bars across front and rear."""
    paint = car.paint if rng.random() < 0.5 else palette.BLACK
    high = rng.uniform(0.14, 0.22)
    y = car.clearance + 0.06 + high / 2
    half = car.length / 2
    front = parts.box((half - 0.03, y, 0), (0.16, high, car.width * 0.86), paint, name="bumper")
    rear = parts.box((-half + 0.03, y + 0.05, 0), (0.16, high, car.width * 0.86), paint, name="bumper")
    return [front, rear]


def _mirrors(car: _Car) -> list[Part]:
    """Door mirrors."""
    x = car.cowl - 0.3 * car.screen
    head = parts.box(
        (x, car.belt + 0.08, car.width / 2 + 0.06), (0.1, 0.13, 0.2), car.paint, taper=(0.8, 0.9), name="mirror"
    )
    return parts.both_sides([head])


def _bed(car: _Car) -> list[Part]:
    """The open box of a pick-up: side walls above the deck, and its floor as a dark sheet."""
    half = car.length / 2
    x0, x1 = -half + 0.06, car.tail - 0.05
    wall, top = 0.06, car.deck + 0.22
    sides = parts.box(
        ((x0 + x1) / 2, (car.deck + top) / 2 - 0.1, car.width / 2 * 0.92),
        (x1 - x0, top - car.deck + 0.2, wall),
        car.paint,
        name="wall",
    )
    gate = parts.box(
        (x0, (car.deck + top) / 2 - 0.1, 0), (wall, top - car.deck + 0.2, car.width * 0.92), car.paint, name="gate"
    )
    floor = parts.grid(
        np.array(
            [
                [[x0, car.deck + 0.05, 0.8], [x0, car.deck + 0.05, -0.8]],
                [[x1, car.deck + 0.05, 0.8], [x1, car.deck + 0.05, -0.8]],
            ]
        ),
        palette.BLACK,
        name="floor",
    )
    return [*parts.both_sides([sides]), gate, floor]


def _roof_rails(car: _Car) -> list[Part]:
    """Two rails along the roof."""
    z = _cabin_half(car, 1.0) * 0.86
    x0, x1 = _cabin_corner(car, 1.0, False) + 0.15, _cabin_corner(car, 1.0, True) - 0.15
    path = [
        (x0, car.roof - 0.02, z),
        (x0 + 0.08, car.roof + 0.06, z),
        (x1 - 0.08, car.roof + 0.06, z),
        (x1, car.roof - 0.02, z),
    ]
    return parts.both_sides([parts.tube(path, 0.02, palette.CHROME, sides=6, name="rail")])


def _spare(car: _Car) -> list[Part]:
    """A spare wheel, its axis along X."""
    tyre = parts.lathe(parts.disc_profile(car.wheel * 0.95, 0.11, 0.04), palette.TYRE, sides=24, axis="x", name="spare")
    return [tyre, parts.lathe(parts.disc_profile(car.wheel * 0.5, 0.13), palette.CHROME, axis="x", name="hub")]


def _spoiler(car: _Car) -> list[Part]:
    """A blade over the boot on two posts."""
    x, y = -car.length / 2 + 0.18, car.deck + 0.2
    blade = parts.box((x, y, 0), (0.28, 0.03, car.width * 0.85), car.paint, name="spoiler")
    post = parts.box((x, car.deck + 0.08, car.width * 0.3), (0.12, 0.26, 0.03), car.paint, name="post")
    return [blade, *parts.both_sides([post])]
