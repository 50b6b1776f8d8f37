"""The colours of a reconstruction where its image sees it, and what it looks like from elsewhere. Frame: v1."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, UInt8
from PIL import Image

from ddf.fields import framed_field
from ddf.geometry import cameras, rays, transforms
from ddf.pictures import shaded

_NEAR = 0.01  # of the size: a point that far behind what the camera sees is seen too
_MIRRORED = np.array([1.0, 1.0, -1.0])
_OPAQUE = 128
_TURNS = (0.0, 90.0, 180.0, 270.0)  # degrees from the image's azimuth


@dataclass(frozen=True)
class Paint:
    """A field, the camera (azimuth, elevation in radians, radius in benchmark units) and the image that it took."""

    field: framed_field.FramedField
    camera: tuple[float, float, float]
    view: UInt8[np.ndarray, "s s 4"]

    def colours(self, points: Float[np.ndarray, "n 3"]) -> UInt8[np.ndarray, "n 3"]:
        """Of points on the surface: what the image shows there, or at the mirror image (x, y, -z), which most things
        look like; the median colour of the object where it shows neither.
        """
        found, seen = self._shown(points)
        found[~seen], mirrored = self._shown(points[~seen] * _MIRRORED)
        found[np.flatnonzero(~seen)[~mirrored]] = np.median(self.view[self.view[..., 3] >= _OPAQUE][:, :3], axis=0)
        return found

    def _shown(self, points: Float[np.ndarray, "n 3"]) -> tuple[UInt8[np.ndarray, "n 3"], Bool[np.ndarray, "n"]]:
        """Colours of the image where points are in it, and which of them it sees."""
        rotation, centre = cameras.extrinsics(*np.array(self.camera))
        place = np.stack(cameras.project(points * transforms.BENCHMARK_FROM_V1, rotation, centre), axis=-1)
        place = np.floor(place * len(self.view) / cameras.IMAGE_SIZE).astype(int)
        seen = (np.clip(place, 0, len(self.view) - 1) == place).all(axis=1)
        column, row = np.where(seen[:, None], place, 0).T
        pixels = self.view[row, column]
        start = centre / transforms.BENCHMARK_FROM_V1
        ways = points - start
        far = np.linalg.norm(ways, axis=1)
        asked = rays.OrientedPoints(np.broadcast_to(start, points.shape), ways / far[:, None])
        seen &= far <= framed_field.query(self.field, asked, ("depth",))[0]["depth"] + _NEAR
        return pixels[:, :3].copy(), seen & (pixels[:, 3] >= _OPAQUE)

    def overlap(self, size: int = 96) -> float:
        """Intersection over union of the field's silhouette, from the image's camera, and the image's own."""
        pixels = cameras.pixel_directions(size, np.zeros(1)).reshape(-1, 3)
        rotation, centre = cameras.extrinsics(*np.array(self.camera))
        ways = pixels @ rotation
        starts = np.broadcast_to(centre / transforms.BENCHMARK_FROM_V1, ways.shape)
        asked = rays.OrientedPoints(starts, ways / np.linalg.norm(ways, axis=1, keepdims=True))
        own = framed_field.query(self.field, asked, ("visibility",))[0]["visibility"] >= framed_field.SEEN
        alpha = np.asarray(Image.fromarray(self.view[..., 3]).resize((size, size), Image.Resampling.BOX))
        given = alpha.ravel() >= _OPAQUE
        return float((own & given).sum() / max(1, (own | given).sum()))

    def sheet(self, size: int = 256, turns: Sequence[float] = _TURNS) -> Image.Image:
        """The image, and the field in its colours, lit, from azimuths that far from the image's, degrees."""
        view = Image.fromarray(self.view).resize((size, size))
        cells = [np.asarray(Image.alpha_composite(Image.new("RGBA", view.size, "white"), view))[..., :3]]
        azimuth, elevation = np.degrees(self.camera[:2])
        radius = max(framed_field.framing_radius(self.field, azimuth + turn, elevation) for turn in turns)
        around = [(azimuth + turn, elevation, radius) for turn in turns]
        standing = shaded.stand(self.field)
        shown = shaded.window(standing, around)
        cells += [shaded.render(standing, each, size, shown, self.colours).picture for each in around]
        return Image.fromarray(np.concatenate(cells, axis=1))
