"""What the parts of a shape wear: textures, two-tone paint, tones and gloss, by category.

The generators of shapes give plain paints; here some of them change, so that what is said by colour varies as much as
it does in collected models, while the mesh stays the same. Lengths and levels are in the v1 frame.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ddf.data.synthetic import palette
from ddf.data.synthetic.palette import Paint, Real, Texture
from ddf.data.synthetic.parts import Part

BARE = 0.12  # of all shapes: one colour all over, as models without materials have
ROOFED = 0.15  # of all cars: the cabin has a paint of its own
TONED = 0.3  # of the names of parts: lighter or darker than their paint
FIXED = (palette.TYRE, palette.CHROME, palette.LAMP, palette.TAIL_LAMP, palette.BLACK)

STILL = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))  # axes of a pattern that has one

Colour = tuple[float, float, float]
Wear = Callable[["Figure", Paint, np.random.Generator], Paint]


@dataclass(frozen=True)
class Figure:
    """The parts of one shape and the box that all of them fill, in the parts' own unit."""

    parts: Sequence[Part]
    lower: np.ndarray
    upper: np.ndarray

    @classmethod
    def of(cls, items: Sequence[Part]) -> "Figure":
        """The shape of some parts."""
        vertices = np.concatenate([part.vertices for part in items])
        return cls(items, vertices.min(axis=0), vertices.max(axis=0))

    def paint(self, name: str) -> Paint | None:
        """That of the first part with this name."""
        return next((part.paint for part in self.parts if part.name == name), None)

    def level(self, name: str, share: float) -> float:
        """y in the v1 frame at a share of a part's height."""
        heights = np.concatenate([part.vertices[:, 1] for part in self.parts if part.name == name])
        place = heights.min() + share * np.ptp(heights)
        centre = (self.lower[1] + self.upper[1]) / 2
        return float((place - centre) / np.linalg.norm(self.upper - self.lower))


def dress(items: Sequence[Part], category: str, rng: np.random.Generator) -> list[Part]:
    """The same parts in other paints; equal paints stay equal but for the tones."""
    if rng.random() < BARE:
        bare = palette.hsv(rng.random(), float(rng.choice([0.0, rng.uniform(0, 0.6)])), rng.uniform(0.3, 0.9), 0.2)
        return [replace(part, paint=bare) for part in items]
    figure, wear = Figure.of(items), WARDROBES.get(category, _anything)
    worn = {paint: wear(figure, paint, rng) for paint in dict.fromkeys(part.paint for part in items)}
    roof = palette.car(rng) if category == "car" and rng.random() < ROOFED else None
    tones = {
        name: float(rng.uniform(0.8, 1.12)) if rng.random() < TONED else 1.0
        for name in dict.fromkeys(part.name for part in items)
    }
    dressed = []
    for part in items:
        paint = roof if roof is not None and part.name == "cabin" else worn[part.paint]
        dressed.append(replace(part, paint=_toned(paint, tones[part.name])))
    return dressed


def _chair(figure: Figure, paint: Paint, rng: np.random.Generator) -> Paint:
    red, green, blue = paint.colour
    kind = rng.random()
    paint = replace(paint, hardness=float(rng.uniform(8, 60)))
    if red > green > blue and paint.gloss == 0.25:  # as `palette.wood` makes it
        return replace(paint, texture=_grain(paint, rng)) if kind < 0.6 else paint
    if paint.gloss > 0.5 or kind > 0.45:  # metal, or plain cloth
        return paint
    pattern = "stripes" if kind < 0.12 else "checks" if kind < 0.2 else "mottled"
    return replace(paint, texture=_pattern(pattern, paint, rng))


def _car(figure: Figure, paint: Paint, rng: np.random.Generator) -> Paint:
    if paint == palette.GLASS:
        shade = float(rng.uniform(0.03, 0.45))
        return replace(paint, colour=(shade, shade * 1.1, shade * 1.25), hardness=float(rng.uniform(16, 90)))
    if paint in FIXED or paint != figure.paint("body"):
        return paint
    paint = replace(paint, gloss=float(rng.uniform(0.2, 1.0)), hardness=float(rng.uniform(16, 90)))
    kind = rng.random()
    if kind < 0.35:
        return replace(paint, texture=_seams(paint, rng))
    if kind < 0.55:
        level = figure.level("body", float(rng.uniform(0.25, 0.6)))
        return replace(paint, texture=_two_tone(level, _other(rng)))
    if kind < 0.62:  # along the middle, as of racing cars
        width = float(rng.uniform(0.03, 0.09))
        return replace(paint, texture=Texture("band", _other(rng), ((0.0, 0.0, 1 / width), *STILL)))
    return replace(paint, texture=_pattern("mottled", paint, rng)) if kind < 0.7 else paint


def _plane(figure: Figure, paint: Paint, rng: np.random.Generator) -> Paint:
    if paint == palette.GLASS:
        shade = float(rng.uniform(0.03, 0.35))
        return replace(paint, colour=(shade, shade * 1.1, shade * 1.25))
    if paint in FIXED:
        return paint
    paint = replace(paint, gloss=float(rng.uniform(0.0, 0.7)), hardness=float(rng.uniform(8, 60)))
    kind = rng.random()
    if paint.colour == (figure.paint("fuselage") or paint).colour:
        if kind < 0.25:
            level = figure.level("fuselage", float(rng.uniform(0.25, 0.55)))
            return replace(paint, texture=_two_tone(level, _other(rng)))
        if kind < 0.45:
            return replace(paint, texture=_cheat_line(figure, rng))
    if 0.45 <= kind < 0.6:
        return replace(paint, texture=_pattern("mottled", paint, rng))
    return replace(paint, texture=_seams(paint, rng)) if kind >= 0.75 else paint


def _anything(figure: Figure, paint: Paint, rng: np.random.Generator) -> Paint:
    kind = str(rng.choice(["plain", "stripes", "checks", "mottled"]))
    return paint if kind == "plain" else replace(paint, texture=_pattern(kind, paint, rng))


# What the paints of a category become; one that is not here wears anything.
WARDROBES: dict[str, Wear] = {"chair": _chair, "car": _car, "plane": _plane}


def _grain(paint: Paint, rng: np.random.Generator) -> Texture:
    """Wood whose grain runs along one axis."""
    along = int(rng.integers(3))
    dense, slow = float(rng.uniform(8, 18)), float(rng.uniform(2, 4))
    rows = np.zeros((3, 3))
    rows[0, [(along + 1) % 3, (along + 2) % 3]] = dense, 0.7 * dense
    rows[1, along], rows[2, (along + 1) % 3] = slow, slow
    return Texture("wood", _scaled(paint.colour, float(rng.uniform(0.45, 0.8))), _rows(rows), _shift(rng))


def _pattern(kind: str, paint: Paint, rng: np.random.Generator) -> Texture:
    """Stripes along any axis, checks, or patches."""
    rows = np.roll(np.eye(3), int(rng.integers(3)), axis=0) * rng.uniform(4, 11)
    second = _scaled(paint.colour, float(rng.uniform(0.5, 0.85))) if rng.random() < 0.6 else _other(rng)
    return Texture(kind, second, _rows(rows), _shift(rng))


def _seams(paint: Paint, rng: np.random.Generator) -> Texture:
    """Gaps between panels, across X and Y."""
    rows = np.diag([rng.uniform(3, 6), rng.uniform(1, 4), 0.0])
    return Texture("panels", _scaled(paint.colour, float(rng.uniform(0.2, 0.6))), _rows(rows), _shift(rng))


def _two_tone(level: float, colour: Colour) -> Texture:
    """Another colour below a level."""
    return Texture("two_tone", colour, ((0.0, -1.0, 0.0), *STILL), (level, 0.0, 0.0))


def _cheat_line(figure: Figure, rng: np.random.Generator) -> Texture:
    """A stripe along the fuselage."""
    level, width = figure.level("fuselage", float(rng.uniform(0.4, 0.6))), float(rng.uniform(0.008, 0.02))
    return Texture("band", _other(rng), ((0.0, 1 / width, 0.0), *STILL), (-level / width, 0.0, 0.0))


def _other(rng: np.random.Generator) -> Colour:
    """White, black, or any colour."""
    kind = rng.random()
    if kind < 0.5:
        value = float(rng.choice([0.05, 0.85]))
        return (value, value, value)
    red, green, blue = palette.hsv(rng.random(), rng.uniform(0.3, 0.9), rng.uniform(0.3, 0.9)).colour
    return (float(red), float(green), float(blue))


def _toned(paint: Paint, factor: float) -> Paint:
    """Paint and pattern, lighter or darker."""
    texture = paint.texture
    if texture is not None:
        texture = replace(texture, colour=_scaled(texture.colour, factor))
    return replace(paint, colour=_scaled(paint.colour, factor), texture=texture)


def _scaled(colour: tuple[Real, Real, Real], factor: float) -> Colour:
    red, green, blue = (min(1.0, float(value) * factor) for value in colour)
    return (red, green, blue)


def _rows(matrix: np.ndarray) -> tuple[tuple[float, float, float], ...]:
    return tuple((float(a), float(b), float(c)) for a, b, c in matrix)


def _shift(rng: np.random.Generator) -> tuple[float, float, float]:
    a, b, c = rng.random(3)
    return (float(a), float(b), float(c))
