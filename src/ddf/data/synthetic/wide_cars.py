"""Cars of more kinds and wider measures than those of `cars`: also city cars, minibuses, lorries and racing cars."""

from dataclasses import replace

import numpy as np

from ddf.data.synthetic import car_parts, cars, palette, parts, plane_parts
from ddf.data.synthetic.car_parts import Car
from ddf.data.synthetic.parts import Part, Real

MEASURES = (
    "length", "width", "roof", "belt / roof", "hood / belt", "deck / belt", "cowl / half", "tail / half",
    "screen", "rear_screen", "wheel", "clearance / wheel", "nose", "bulge",
)  # fmt: skip
# Share and ranges of each style; metres, ratios, and the screens' leans over their height.
STYLES: dict[str, tuple[Real, tuple[tuple[Real, Real], ...]]] = {
    "city": (0.07, ((2.6, 3.7), (1.5, 1.75), (1.4, 1.65), (0.52, 0.64), (0.7, 0.95), (1.0, 1.0), (0.4, 0.75),
        (-1.0, -0.92), (0.7, 1.5), (0.1, 0.7), (0.27, 0.33), (0.4, 0.8), (0.75, 0.95), (0.3, 1.0))),
    "hatchback": (0.09, ((3.7, 4.5), (1.65, 1.9), (1.35, 1.55), (0.56, 0.66), (0.72, 0.95), (1.0, 1.0), (0.3, 0.5),
        (-1.0, -0.92), (0.9, 1.9), (0.4, 1.5), (0.29, 0.36), (0.4, 0.8), (0.75, 0.95), (0.2, 1.0))),
    "saloon": (0.15, ((4.1, 5.3), (1.65, 2.05), (1.15, 1.6), (0.52, 0.68), (0.75, 1.0), (0.9, 1.03), (0.22, 0.45),
        (-0.82, -0.5), (0.6, 2.0), (0.6, 1.9), (0.28, 0.36), (0.4, 0.8), (0.75, 1.0), (0.0, 1.0))),
    "estate": (0.06, ((4.2, 5.0), (1.7, 1.95), (1.35, 1.6), (0.55, 0.66), (0.72, 0.95), (1.0, 1.0), (0.28, 0.45),
        (-1.0, -0.93), (0.9, 1.8), (0.2, 1.1), (0.29, 0.36), (0.4, 0.8), (0.75, 0.95), (0.2, 1.0))),
    "suv": (0.09, ((4.1, 5.1), (1.75, 2.1), (1.55, 1.95), (0.54, 0.68), (0.78, 1.0), (1.0, 1.0), (0.28, 0.48),
        (-1.0, -0.93), (0.5, 1.6), (0.1, 0.9), (0.34, 0.44), (0.5, 0.95), (0.75, 1.0), (0.0, 1.0))),
    "jeep": (0.1, ((3.3, 4.7), (1.6, 2.4), (1.5, 2.05), (0.5, 0.7), (0.85, 1.0), (1.0, 1.0), (0.1, 0.45),
        (-1.0, -0.93), (0.05, 0.6), (0.0, 0.2), (0.36, 0.5), (0.6, 1.2), (0.6, 1.0), (0.0, 0.5))),
    "van": (0.08, ((3.9, 5.6), (1.7, 2.2), (1.8, 2.6), (0.48, 0.66), (0.65, 1.0), (1.0, 1.0), (0.35, 0.9),
        (-1.0, -0.93), (0.2, 1.2), (0.0, 0.2), (0.3, 0.42), (0.4, 1.0), (0.8, 1.0), (0.0, 0.6))),
    "lorry": (0.06, ((4.8, 7.5), (1.9, 2.5), (2.0, 2.8), (0.5, 0.62), (0.75, 1.0), (0.95, 1.0), (0.55, 0.96),
        (0.2, 0.4), (0.0, 0.4), (0.0, 0.1), (0.38, 0.55), (0.7, 1.2), (0.85, 1.0), (0.0, 0.5))),
    "pickup": (0.06, ((4.6, 5.8), (1.7, 2.1), (1.5, 1.95), (0.54, 0.66), (0.75, 1.0), (0.85, 1.0), (0.25, 0.45),
        (-0.25, 0.05), (0.3, 1.3), (0.0, 0.3), (0.34, 0.46), (0.5, 1.1), (0.75, 1.0), (0.0, 1.0))),
    "sports": (0.06, ((3.8, 4.7), (1.7, 2.05), (1.05, 1.35), (0.54, 0.7), (0.65, 0.92), (0.9, 1.08), (0.1, 0.4),
        (-0.9, -0.55), (1.1, 2.2), (1.0, 2.6), (0.28, 0.36), (0.25, 0.7), (0.7, 0.95), (0.4, 1.0))),
    "race": (0.12, ((4.0, 4.8), (1.8, 2.15), (1.0, 1.35), (0.55, 0.72), (0.6, 0.95), (0.9, 1.1), (0.05, 0.4),
        (-0.88, -0.45), (1.0, 2.2), (1.0, 2.6), (0.28, 0.37), (0.15, 0.5), (0.75, 1.0), (0.2, 1.0))),
    "roadster": (0.04, ((3.4, 4.6), (1.55, 2.0), (1.0, 1.5), (0.6, 0.8), (0.65, 1.0), (0.85, 1.05), (0.1, 0.4),
        (-0.7, -0.4), (0.2, 1.5), (0.5, 0.5), (0.28, 0.42), (0.3, 0.9), (0.6, 0.95), (0.1, 1.0))),
    "formula": (0.02, ((4.2, 5.0), (1.7, 2.05), (0.8, 1.1), (0.5, 0.7), (0.6, 0.8), (1.0, 1.0), (0.1, 0.3),
        (-0.7, -0.5), (0.5, 0.5), (0.5, 0.5), (0.3, 0.36), (0.3, 0.5), (0.8, 0.8), (0.5, 0.5))),
}  # fmt: skip
RACERS = ("race", "sports", "saloon", "hatchback")


def build(rng: np.random.Generator) -> list[Part]:
    """One car."""
    names = list(STYLES)
    style = str(rng.choice(names, p=[share for share, _ in STYLES.values()]))
    car = _measures(rng, style)
    pieces = car_parts.wheels(rng, car)
    if style == "formula":
        return pieces + _formula(rng, car)
    pieces += [cars.body(car), *car_parts.lamps(rng, car), *car_parts.bumpers(rng, car)]
    pieces += cars.open_cabin(rng, car) if style == "roadster" else cars.cabin(rng, car)
    racing = style in RACERS and rng.random() < (0.9 if style == "race" else 0.25)
    if racing:
        pieces += [*_rear_wing(rng, car), *_skirts(rng, car)]
    if rng.random() < (0.4 if racing else 0.75):
        pieces += car_parts.mirrors(car)
    if style == "pickup" or (style == "lorry" and rng.random() < 0.3):
        pieces += car_parts.bed(car)
    elif style == "lorry":
        pieces.append(_cargo(rng, car))
    if style in ("suv", "estate", "van", "jeep") and rng.random() < 0.3:
        pieces += car_parts.roof_rails(car)
    if style in ("saloon", "estate") and rng.random() < 0.12:
        middle = (car.cabin_corner(1.0, True) + car.cabin_corner(1.0, False)) / 2
        pieces.append(parts.box((middle, car.roof + 0.04, 0), (0.25, 0.14, 1.1), palette.TAIL_LAMP, name="beacon"))
    if style == "jeep" and rng.random() < 0.5:
        pieces += [part.moved(-car.length / 2 - 0.1, car.belt * 0.85, 0) for part in car_parts.spare(car)]
    return pieces


def _measures(rng: np.random.Generator, style: str) -> Car:
    """Proportions of a style; the screens stand steeper where the roof would be short."""
    drawn = dict(zip(MEASURES, (float(rng.uniform(*span)) for span in STYLES[style][1]), strict=True))
    half, belt = drawn["length"] / 2, drawn["belt / roof"] * drawn["roof"]
    cowl, tail = drawn["cowl / half"] * half, drawn["tail / half"] * half
    leans = np.array([drawn["screen"], drawn["rear_screen"]]) * (drawn["roof"] - belt)
    leans *= min(1.0, 0.8 * (cowl - tail) / max(leans.sum(), 1e-6))
    return Car(
        length=drawn["length"],
        width=drawn["width"],
        hood=drawn["hood / belt"] * belt,
        belt=belt,
        deck=drawn["deck / belt"] * belt,
        roof=drawn["roof"],
        cowl=cowl,
        screen=float(leans[0]),
        tail=tail,
        rear_screen=float(leans[1]),
        clearance=drawn["clearance / wheel"] * drawn["wheel"],
        wheel=drawn["wheel"],
        axles=(
            -half + rng.uniform(0.15, 0.24) * drawn["length"],
            half - rng.uniform(0.13, 0.21) * drawn["length"],
        ),
        nose=drawn["nose"],
        bulge=drawn["bulge"],
        paint=palette.car(rng),
    )


def _cargo(rng: np.random.Generator, car: Car) -> Part:
    """A lorry's closed box behind the cab."""
    x0, x1 = -car.length / 2, car.tail - rng.uniform(0.0, 0.1)
    y0, y1 = 0.8 * car.deck, car.roof * rng.uniform(0.9, 1.25)
    size = (x1 - x0, y1 - y0, car.width * rng.uniform(0.95, 1.05))
    paint = car.paint if rng.random() < 0.5 else palette.car(rng)
    return parts.box(((x0 + x1) / 2, (y0 + y1) / 2, 0), size, paint, name="cargo")


def _rear_wing(rng: np.random.Generator, car: Car) -> list[Part]:
    """A blade over the tail between two posts or end plates."""
    x, y = -car.length / 2 + rng.uniform(0.0, 0.3), car.deck + rng.uniform(0.12, 0.4)
    chord, wide = rng.uniform(0.2, 0.45), car.width * rng.uniform(0.7, 0.95)
    blade = parts.box((x, y, 0), (chord, rng.uniform(0.02, 0.06), wide), car.paint, name="spoiler")
    z = wide * float(rng.choice([0.25, 0.5]))
    foot = 0.75 * car.deck
    post = parts.box((x + 0.1, (foot + y) / 2, z), (chord, y - foot + 0.06, 0.03), car.paint, name="post")
    return [blade.turned("z", rng.uniform(0, 0.2), (x, y, 0)), *parts.both_sides([post])]


def _skirts(rng: np.random.Generator, car: Car) -> list[Part]:
    """A sill between the wheels, and a lip in front of them."""
    rear, front = car.axles
    low, high, half = 0.5 * car.clearance, car.clearance + 0.1, car.length / 2
    sill = (front - rear - 2.5 * car.wheel, high - low, car.width * rng.uniform(0.96, 1.04))
    pieces = [parts.box(((front + rear) / 2, (low + high) / 2, 0), sill, car.paint, name="skirt")]
    lip = half - front - 1.25 * car.wheel + rng.uniform(0.0, 0.12)
    centre = (front + 1.25 * car.wheel + lip / 2, (low + high) / 2, 0)
    return [*pieces, parts.box(centre, (lip, high - low, car.width * 0.94), car.paint, name="skirt")]


def _formula(rng: np.random.Generator, car: Car) -> list[Part]:
    """A single-seater: slender body and side boxes between bare wheels, a wing at each end."""
    half, wheel, wide = car.length / 2, car.wheel, car.width
    stations = [
        (-half + 0.1, 0.4, 0.3, 0.3),
        (-0.45 * half, 0.42, 0.55, 0.55),
        (-0.05 * half, 0.4, 0.75, 0.55),
        (0.3 * half, 0.38, 0.55, 0.42),
        (0.7 * half, 0.36, 0.35, 0.28),
        (half, 0.28, 0.16, 0.1),
    ]
    pieces = [replace(plane_parts.fuselage(stations, car.paint, power=3.0), name="body")]
    long, across = 0.75 * half, 0.2 * wide
    box = parts.box((-0.2 * half, 0.33, 0.22 * wide), (long, 0.42, across), car.paint, taper=(0.85, 0.9), name="pod")
    bars = [parts.beam((x, wheel, 0), (x, wheel, wide / 2 - 0.12), 0.05, palette.BLACK) for x in car.axles]
    rear = parts.box((-half + 0.15, 0.55, 0.22 * wide), (0.45, 0.75 * car.roof, 0.03), car.paint, name="post")
    pieces += parts.both_sides([box, *bars, rear])
    top = 0.55 + 0.375 * car.roof
    pieces += [
        parts.box((-half + 0.12, top, 0), (0.4, 0.05, 0.5 * wide), car.paint, name="spoiler"),
        parts.box((half - 0.12, 0.22, 0), (0.45, 0.05, rng.uniform(0.7, 0.95) * wide), car.paint, name="spoiler"),
        parts.box((-0.3 * half, 0.7, 0), (0.7, 0.5, 0.28), car.paint, taper=(0.4, 0.6), name="airbox"),
        parts.box((0.02 * half, 0.68, 0), (0.25, 0.25, 0.24), palette.BLACK, taper=(0.6, 0.6), name="helmet"),
    ]
    return pieces
