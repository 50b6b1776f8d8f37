"""Cars, facing +X, wheels on the ground, in metres: `build` in nine styles, `build_wide` in more and wider ones."""

from dataclasses import replace
from typing import Any

import numpy as np

from ddf.data.synthetic import car_parts, palette, parts, plane_parts
from ddf.data.synthetic.car_parts import Car
from ddf.data.synthetic.parts import Part, Real

# Of each style its share; length, width, roof and wheel in metres; belt over roof; cowl and tail over half the length;
# deck over belt; leans of the screens. None: drawn.
STYLES: dict[str, tuple[Any, ...]] = {
    "hatchback": (0.18, 3.9, 1.7, 1.48, 0.32, 0.62, 0.42, -0.985, 1.0, 1.0, 0.6),
    "saloon": (0.24, 4.7, 1.8, 1.43, 0.32, 0.62, 0.36, None, None, 1.0, 1.3),
    "estate": (0.1, 4.7, 1.8, 1.48, 0.32, 0.62, 0.36, -0.985, 1.0, 1.0, 0.4),
    "suv": (0.13, 4.6, 1.88, 1.75, 0.38, 0.62, 0.36, -0.985, 1.0, 1.0, 0.18),
    "jeep": (0.05, 4.0, 1.75, 1.85, 0.4, 0.62, 0.36, -0.985, 1.0, 0.25, 0.18),
    "van": (0.09, 4.9, 1.9, 2.05, 0.35, 0.55, 0.62, -0.985, 1.0, 0.75, 0.18),
    "pickup": (0.08, 5.2, 1.9, 1.75, 0.39, 0.62, 0.34, -0.12, 0.98, 1.0, 0.18),
    "sports": (0.08, 4.3, 1.85, 1.2, 0.32, 0.62, 0.22, -0.66, 0.95, 1.0, 1.7),
    "convertible": (0.05, 4.3, 1.78, 1.32, 0.32, 0.62, 0.36, -0.55, 0.97, 1.0, 0.18),
}
MEASURES = (
    "length", "width", "roof", "belt / roof", "hood / belt", "deck / belt", "cowl / half", "tail / half",
    "screen", "rear_screen", "wheel", "clearance / wheel", "nose", "bulge",
)  # fmt: skip
# Of `build_wide`: share and ranges of each style; metres, ratios, and the screens' leans over their height.
WIDE_STYLES: dict[str, tuple[Real, tuple[tuple[Real, Real], ...]]] = {
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
    style = str(rng.choice(list(STYLES), p=[row[0] for row in STYLES.values()]))
    car = _measures(rng, style)
    pieces = [car_parts.body(car), *car_parts.wheels(rng, car), *car_parts.lamps(rng, car)]
    pieces += car_parts.bumpers(rng, car)
    pieces += car_parts.open_cabin(rng, car) if style == "convertible" else car_parts.cabin(rng, car)
    if rng.random() < 0.85:
        pieces += car_parts.mirrors(car)
    if style == "pickup":
        pieces += car_parts.bed(car)
    if style in ("suv", "estate", "van") and rng.random() < 0.45:
        pieces += car_parts.roof_rails(car)
    if style == "sports" and rng.random() < 0.5:
        pieces += car_parts.spoiler(car)
    return pieces + (car_parts.spare(car) if style == "jeep" and rng.random() < 0.7 else [])


def build_wide(rng: np.random.Generator) -> list[Part]:
    """One car of any kind, also a city car, minibus, lorry or racing car."""
    style = str(rng.choice(list(WIDE_STYLES), p=[share for share, _ in WIDE_STYLES.values()]))
    car = _wide_measures(rng, style)
    pieces = car_parts.wheels(rng, car)
    if style == "formula":
        return pieces + _formula(rng, car)
    pieces += [car_parts.body(car), *car_parts.lamps(rng, car), *car_parts.bumpers(rng, car)]
    pieces += car_parts.open_cabin(rng, car) if style == "roadster" else car_parts.cabin(rng, car)
    racing = style in RACERS and rng.random() < (0.9 if style == "race" else 0.25)
    if racing:
        pieces += [*car_parts.racing_wing(rng, car), *car_parts.skirts(rng, car)]
    if rng.random() < (0.4 if racing else 0.75):
        pieces += car_parts.mirrors(car)
    if style == "pickup" or (style == "lorry" and rng.random() < 0.3):
        pieces += car_parts.bed(car)
    elif style == "lorry":
        pieces.append(car_parts.cargo(rng, car))
    if style in ("suv", "estate", "van", "jeep") and rng.random() < 0.3:
        pieces += car_parts.roof_rails(car)
    if style in ("saloon", "estate") and rng.random() < 0.12:
        pieces.append(car_parts.beacon(car))
    return pieces + (car_parts.spare(car) if style == "jeep" and rng.random() < 0.5 else [])


def _measures(rng: np.random.Generator, style: str) -> Car:
    """Proportions of a style, with variation."""
    _, *sizes, wheel, belt, cowl, tail, deck, screen, rear_screen = STYLES[style]
    length, width, roof = (value * rng.uniform(0.94, 1.06) for value in sizes)
    half, wheel = length / 2, wheel * rng.uniform(0.94, 1.1)
    belt = belt * roof * rng.uniform(0.96, 1.04)
    hood = belt * (0.97 if style == "jeep" else rng.uniform(0.74, 0.92))
    drawn = rng.uniform(-0.7, -0.56), rng.uniform(0.93, 1.0)
    return Car(
        length=length,
        width=width,
        hood=hood,
        belt=belt,
        deck=belt * (drawn[1] if deck is None else deck),
        roof=roof,
        cowl=cowl * half + rng.uniform(-0.05, 0.05),
        screen=(roof - belt) * rng.uniform(0.95, 1.5) * screen,
        tail=(drawn[0] if tail is None else tail) * half,
        rear_screen=(roof - belt) * rear_screen * rng.uniform(0.8, 1.2),
        clearance=wheel * rng.uniform(0.5, 0.75),
        wheel=wheel,
        axles=(-half + rng.uniform(0.17, 0.21) * length, half - rng.uniform(0.165, 0.2) * length),
        nose=0.6 if style == "jeep" else rng.uniform(0.76, 0.9),
        bulge=rng.uniform(0.25, 0.5) if style in ("jeep", "van") else rng.uniform(0.55, 1.0),
        paint=palette.car(rng),
    )


def _wide_measures(rng: np.random.Generator, style: str) -> Car:
    """Proportions of a style; the screens stand steeper where the roof would be short."""
    drawn = dict(zip(MEASURES, (float(rng.uniform(*span)) for span in WIDE_STYLES[style][1]), strict=True))
    half, belt = drawn["length"] / 2, drawn["belt / roof"] * drawn["roof"]
    cowl, tail = drawn["cowl / half"] * half, drawn["tail / half"] * half
    leans = np.array([drawn["screen"], drawn["rear_screen"]]) * (drawn["roof"] - belt)
    leans *= min(1.0, 0.8 * (cowl - tail) / max(leans.sum(), 1e-6))
    axles = (-half + rng.uniform(0.15, 0.24) * drawn["length"], half - rng.uniform(0.13, 0.21) * drawn["length"])
    return Car(
        **{name: drawn[name] for name in ("length", "width", "roof", "wheel", "nose", "bulge")},
        hood=drawn["hood / belt"] * belt,
        belt=belt,
        deck=drawn["deck / belt"] * belt,
        cowl=cowl,
        screen=float(leans[0]),
        tail=tail,
        rear_screen=float(leans[1]),
        clearance=drawn["clearance / wheel"] * drawn["wheel"],
        axles=axles,
        paint=palette.car(rng),
    )


def _formula(rng: np.random.Generator, car: Car) -> list[Part]:
    """A single-seater: slender body and side boxes between bare wheels, a wing at each end."""
    half, wheel, wide = car.length / 2, car.wheel, car.width
    stations = [
        (-half + 0.1, 0.4, 0.3, 0.3), (-0.45 * half, 0.42, 0.55, 0.55), (-0.05 * half, 0.4, 0.75, 0.55),
        (0.3 * half, 0.38, 0.55, 0.42), (0.7 * half, 0.36, 0.35, 0.28), (half, 0.28, 0.16, 0.1),
    ]  # fmt: skip
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
