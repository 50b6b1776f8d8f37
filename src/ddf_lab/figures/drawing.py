"""Dots, arrows and planes over the shaded picture of a field, all in the frame of its mesh."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from PIL import Image, ImageDraw

from ddf.geometry import rays
from ddf.pictures import field_pictures, picture_strips, shaded

Points = Float[np.ndarray, "n 3"]
Colour = tuple[int, int, int]
SIGHT, MISSED = (90, 180, 190), (205, 60, 50)  # the way to what is seen; looks of points that see nothing
_HIT, _MISS, _LOOK = (31, 95, 168), (30, 30, 30), (60, 150, 80)  # points that see something, and nothing; looks
NOTHING = np.array([0.80, 0.82, 0.85])  # of a plane, where v meets nothing
_OVERSAMPLING, _MARGIN, _FADED, _CLEAR = 2, 1.06, 0.55, 0.35


@dataclass
class Drawing:
    """A picture of `size` pixels a side, in the making; `image` is larger."""

    standing: shaded.Standing
    camera: shaded.Camera
    shown: shaded.Window
    size: int
    image: Image.Image

    @classmethod
    def around(
        cls, standing: shaded.Standing, camera: shaded.Camera, points: Points, size: int, shape: bool = True
    ) -> "Drawing":
        """The faded picture of the object, or without `shape` an empty one, that holds the points."""
        places = shaded.project(standing, camera, points)
        low, high = places.min(0), places.max(0)
        side = _MARGIN * float((high - low).max())
        left, top = ((low + high - side) / 2).tolist()
        large, shown = size * _OVERSAMPLING, (left, top, side)
        picture = np.full((large, large, 3), 255.0)
        if shape:
            drawn = shaded.render(standing, camera, size, shown).picture
            picture = np.asarray(Image.fromarray(drawn).resize((large, large), Image.Resampling.BICUBIC))
        faded = np.rint(255 - _FADED * (255.0 - picture)).astype(np.uint8)
        return cls(standing, camera, shown, size, Image.fromarray(faded))

    def place(self, points: Points) -> list[tuple[float, float]]:
        """Pixels of the large picture."""
        shares = (shaded.project(self.standing, self.camera, points) - self.shown[:2]) / self.shown[2]
        return [(float(x), float(y)) for x, y in shares * self.image.width]

    def lines(self, starts: Points, ends: Points, colour: Colour, width: float = 1.0) -> None:
        """Straight lines; width in pixels."""
        pen = ImageDraw.Draw(self.image)
        for start, end in zip(self.place(starts), self.place(ends), strict=True):
            pen.line([start, end], fill=colour, width=round(width * _OVERSAMPLING))

    def arrows(self, starts: Points, ends: Points, colour: Colour, width: float) -> None:
        """Lines with heads."""
        self.lines(starts, ends, colour, width)
        pen, head = ImageDraw.Draw(self.image), (3 + 1.5 * width) * _OVERSAMPLING
        for start, end in zip(map(np.array, self.place(starts)), map(np.array, self.place(ends)), strict=True):
            along = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
            aside = 0.45 * head * np.array([-along[1], along[0]])
            tip = end + 0.5 * head * along
            pen.polygon([tuple(each) for each in (tip, tip - head * along + aside, tip - head * along - aside)], colour)

    def dots(self, points: Points, colour: Colour, radius: float) -> None:
        """Discs; radius in pixels."""
        pen, reach = ImageDraw.Draw(self.image), radius * _OVERSAMPLING
        for x, y in self.place(points):
            pen.ellipse([x - reach, y - reach, x + reach, y + reach], fill=colour)

    def looks(self, starts: Points, ends: Points, seen: Bool[np.ndarray, "n"], width: float, radius: float) -> None:
        """Oriented points as dots with arrows, those that see something in other colours than the rest."""
        for chosen, dot, arrow in ((seen, _HIT, _LOOK), (~seen, _MISS, MISSED)):
            self.arrows(starts[chosen], ends[chosen], arrow, width)
            self.dots(starts[chosen], dot, radius)

    def planes(
        self, levels: Sequence[tuple[float, float]], box: Points, depth: Callable[[Points], Float[np.ndarray, "n"]]
    ) -> None:
        """Planes z = const of a box, coloured by depth at their points, clear grey where that is infinite.

        Args:
          levels: of each plane where it is drawn, and the z of its points. box: two corners.
        """
        pixels = np.asarray(self.image).reshape(-1, 3) / 255.0
        looks = shaded.camera_rays(self.standing, self.camera, self.shown, self.image.width)
        found = []
        for at, z in levels:
            distance = (at - looks.positions[:, 2]) / looks.directions[:, 2]
            points = rays.surface_points(looks.positions, looks.directions, distance)
            within = ((points >= box[0]) & (points <= box[1]))[:, :2].all(axis=1) & (distance > 0)
            points[:, 2] = z
            found.append((distance, within, depth(points[within])))
        finite = np.concatenate([values[np.isfinite(values)] for _, _, values in found])
        near, far = np.percentile(finite, [1, 99])
        order = sorted(range(len(found)), key=lambda each: -found[each][0][found[each][1]].mean())
        for each in order:
            _, within, values = found[each]
            seen = np.isfinite(values)
            level = np.clip((np.where(seen, values, far) - near) / (far - near), 0.0, 1.0)
            clear = pixels[within] * (1 - _CLEAR) + _CLEAR * NOTHING
            pixels[within] = np.where(seen[:, None], field_pictures.colours(1.0 - level), clear)
        side = self.image.width
        self.image = Image.fromarray(np.rint(255 * pixels).astype(np.uint8).reshape(side, side, 3))

    def picture(self) -> picture_strips.Picture:
        """What is drawn, averaged down."""
        return np.asarray(self.image.resize((self.size, self.size), Image.Resampling.LANCZOS))
