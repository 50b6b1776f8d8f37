"""Styles and measures of cars, and what hangs on a body: wheels, lamps, bumpers, mirrors, a bed, rails, a spoiler."""

from dataclasses import dataclass

import numpy as np

from ddf.data.synthetic import palette, parts
from ddf.data.synthetic.parts import Paint, Part, Real

STYLES = ("hatchback", "saloon", "estate", "suv", "jeep", "van", "pickup", "sports", "convertible")
STYLE_ODDS = (0.18, 0.24, 0.1, 0.13, 0.05, 0.09, 0.08, 0.08, 0.05)


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


def measures(rng: np.random.Generator, style: str) -> Car:
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
    return Car(
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


def wheels(rng: np.random.Generator, car: Car) -> list[Part]:
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


def lamps(rng: np.random.Generator, car: Car) -> list[Part]:
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


def bumpers(rng: np.random.Generator, car: Car) -> list[Part]:
    """Bars across front and rear."""
    paint = car.paint if rng.random() < 0.5 else palette.BLACK
    high = rng.uniform(0.14, 0.22)
    y = car.clearance + 0.06 + high / 2
    half = car.length / 2
    front = parts.box((half - 0.03, y, 0), (0.16, high, car.width * 0.86), paint, name="bumper")
    rear = parts.box((-half + 0.03, y + 0.05, 0), (0.16, high, car.width * 0.86), paint, name="bumper")
    return [front, rear]


def mirrors(car: Car) -> list[Part]:
    """Door mirrors."""
    x = car.cowl - 0.3 * car.screen
    head = parts.box(
        (x, car.belt + 0.08, car.width / 2 + 0.06), (0.1, 0.13, 0.2), car.paint, taper=(0.8, 0.9), name="mirror"
    )
    return parts.both_sides([head])


def bed(car: Car) -> list[Part]:
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


def roof_rails(car: Car) -> list[Part]:
    """Two rails along the roof."""
    z = car.cabin_half(1.0) * 0.86
    x0, x1 = car.cabin_corner(1.0, False) + 0.15, car.cabin_corner(1.0, True) - 0.15
    path = [
        (x0, car.roof - 0.02, z),
        (x0 + 0.08, car.roof + 0.06, z),
        (x1 - 0.08, car.roof + 0.06, z),
        (x1, car.roof - 0.02, z),
    ]
    return parts.both_sides([parts.tube(path, 0.02, palette.CHROME, sides=6, name="rail")])


def spare(car: Car) -> list[Part]:
    """A spare wheel, its axis along X."""
    tyre = parts.lathe(parts.disc_profile(car.wheel * 0.95, 0.11, 0.04), palette.TYRE, sides=24, axis="x", name="spare")
    return [tyre, parts.lathe(parts.disc_profile(car.wheel * 0.5, 0.13), palette.CHROME, axis="x", name="hub")]


def spoiler(car: Car) -> list[Part]:
    """A blade over the boot on two posts."""
    x, y = -car.length / 2 + 0.18, car.deck + 0.2
    blade = parts.box((x, y, 0), (0.28, 0.03, car.width * 0.85), car.paint, name="spoiler")
    post = parts.box((x, car.deck + 0.08, car.width * 0.3), (0.12, 0.26, 0.03), car.paint, name="post")
    return [blade, *parts.both_sides([post])]
