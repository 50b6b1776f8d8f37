"""The thing that a picture shows, frame of v1: its closed mesh, and its colours or its texture by the picture.

The mesh is made of the field, its cloud and the picture's own outline.
The field is looked at from all sides (`carved_surface`) and once more, with more weight, by the picture's camera. A
look meets the first of the surfaces that an unsure field says, so the mean of all looks is 0 in front of the surface:
thick parts end where it is less (by how much was chosen on validation shapes). Parts without such a node end around
their own least mean: thin legs stay. At the picture's outline the level is high, for the outline itself says where the
object ends.
What projects beside the object is empty. Where an opaque pixel has nothing behind it, the likeliest nodes along its
rays are filled in, if enough looks agree: legs that the field nearly sees stay. Small parts go, but those that the
picture shows where nothing else is.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from PIL import Image
from scipy import ndimage

from ddf.core import checks
from ddf.fields import framed_field
from ddf.fit import surfaces
from ddf.geometry import cameras, carved_surface, rays, textured, transforms
from ddf.geometry.mesh_io import Mesh
from ddf.pictures import shaded

OPAQUE = 128  # of 255
_CELLS = 80  # along the longest side
_MARGIN = 0.05  # of the cloud's longest side, around it
_OWN = 4.0  # weight of the picture's camera, in looks from a side
_GROWN, _STEEP, _ASKED = 0.15, 1.5, 2.0  # cells beside the outline: of its surface, its slope, how far nodes matter
_THICK, _THIN = -0.8, 0.5  # cells: mean at the surface of thick parts; of thin ones, above the least around
_ENOUGH = -1.0  # cells: a node that far inside explains its pixels, or one that the outline allows no farther
_LIKELY, _AS_LIKELY = 1.7, 0.3  # cells: nodes that are filled in, and how much those of a ray may differ
_AROUND, _WEIGHT = 2.5, 2.0  # cells around a node whose mean makes it likelier, and the weight of that mean
_LEAST, _SHOWN = 0.01, 20  # of the largest part; nodes that alone explain their pixels
_NEAR = 0.01  # of the size: a point that far behind what the camera sees is seen too
_STRIPE = 8  # pixels
_MIRRORED = np.array([1.0, 1.0, -1.0])
_TURNS = (0.0, 90.0, 180.0, 270.0)  # degrees from the image's azimuth


def solid(
    field: framed_field.FramedField,
    cloud: Float[np.ndarray, "n 3"],
    camera: tuple[float, float, float],
    alpha: UInt8[np.ndarray, "s s"],
) -> Mesh:
    """The closed surface, frame of v1.

    Args:
      cloud: points on the surface; no part of it lies far from them. camera: azimuth, elevation (radians) and radius
        (benchmark units) of the picture. alpha: of the picture.
    Raises:
      InputError: nothing is left, or the picture shows nothing there.
    """
    lower, upper = surfaces.box(field)
    margin = _MARGIN * np.ptp(cloud, axis=0).max()
    grid = carved_surface.Grid.around(
        np.maximum(lower, cloud.min(axis=0) - margin), np.minimum(upper, cloud.max(axis=0) + margin), _CELLS
    )
    rotation, centre = cameras.extrinsics(*np.array(camera))
    start, nodes = centre / transforms.BENCHMARK_FROM_V1, grid.nodes()
    scale = cameras.FOCAL_PX * grid.cell / float(np.linalg.norm(start))  # pixels a cell, about
    place = np.stack(cameras.project(nodes * transforms.BENCHMARK_FROM_V1, rotation, centre)[::-1])
    beside = _beside(alpha >= OPAQUE, scale, place)
    chosen = np.flatnonzero(beside < _ASKED)
    if not len(chosen):
        raise checks.InputError("the picture's object is not where the model places its shape: give another picture")
    beside, place = beside[chosen] - _GROWN, place[:, chosen]
    votes, look = carved_surface.Votes(grid, chosen), surfaces.look(field)
    votes.look_around(look)
    size = int(cameras.IMAGE_SIZE / scale)
    row, column = np.clip((place / scale).astype(int), 0, size - 1)
    pixel = row * size + column  # as large as a cell
    used, back = np.unique(pixel, return_inverse=True)
    directions = cameras.directions_at(*(scale * (np.stack(divmod(used, size)[::-1]) + 0.5))) @ rotation
    seen = look(np.broadcast_to(start, directions.shape).copy(), directions)
    votes.add(seen[back] - np.linalg.norm(nodes[chosen] - start, axis=1), _OWN)
    mean, outside = votes.mean(), _STEEP * beside
    least = ndimage.minimum_filter(_everywhere(grid, chosen, mean), 3).ravel()[chosen]
    rim = _THICK + (carved_surface.LEVEL - _THICK) * (1 + beside)  # from one cell within the outline on
    found = mean - np.clip(np.maximum(least + _THIN, rim), _THICK, carved_surface.LEVEL)
    explains = (found <= np.maximum(outside, _ENOUGH)) & (beside < 0)
    found = np.maximum(found, outside)
    covered = np.bincount(pixel[explains], minlength=size**2) > 0
    bare = ~ndimage.binary_closing(covered.reshape(size, size)).ravel()[pixel]
    around = ndimage.gaussian_filter(_everywhere(grid, chosen, found), _AROUND, truncate=2).ravel()[chosen]
    likely = found + _WEIGHT * around
    best = np.full(size**2, np.inf, found.dtype)
    np.minimum.at(best, pixel, likely)
    filled = bare & (beside < 0) & (likely < best[pixel] + _AS_LIKELY) & (found < _LIKELY)
    found = np.where(filled, np.maximum(np.minimum(found, _ENOUGH), outside), found)
    values = _everywhere(grid, chosen, found)
    part, count = ndimage.label(values < 0, ndimage.generate_binary_structure(3, 2))  # what the surface joins
    part = part.ravel()[chosen]
    sizes = np.bincount(part, minlength=count + 1)
    large = sizes >= _LEAST * sizes[1:].max(initial=0)
    explained = np.bincount(pixel[large[part] & (part > 0)], minlength=size**2) > 0
    large |= np.bincount(part[~explained[pixel]], minlength=count + 1) >= _SHOWN
    return carved_surface.surface(grid, _everywhere(grid, chosen, np.where(large[part], found, carved_surface.REACH)))


def _everywhere(
    grid: carved_surface.Grid, chosen: Int[np.ndarray, "n"], values: Float[np.ndarray, "n"]
) -> Float[np.ndarray, "x y z"]:
    """Values of the chosen nodes on the grid, elsewhere far outside."""
    whole = np.full(np.prod(grid.shape), carved_surface.REACH, np.float32)
    whole[chosen] = values
    return whole.reshape(grid.shape)


def _beside(opaque: np.ndarray, scale: float, place: Float[np.ndarray, "2 n"]) -> Float[np.ndarray, "n"]:
    """How far beside the object places (row, column in `cameras`' pixels) are, in cells; negative within."""
    ratio = len(opaque) / cameras.IMAGE_SIZE
    rim = int(np.ceil((_ASKED + 1) * scale * ratio))
    framed = np.pad(opaque, rim)
    out, within = (ndimage.distance_transform_edt(each) for each in (~framed, framed))
    signed = np.where(framed, 0.5 - within, out - 0.5).astype(np.float32) / (scale * ratio)
    return ndimage.map_coordinates(signed, place * ratio - 0.5 + rim, order=1, mode="nearest", output=np.float32)


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
        found[np.flatnonzero(~seen)[~mirrored]] = self._usual()
        return found

    def _usual(self) -> Float[np.ndarray, "3"]:
        """The median colour of the object."""
        return np.median(self.view[self.view[..., 3] >= OPAQUE][:, :3], axis=0)

    def textured(self, mesh: Mesh) -> bytes:
        """A GLB of a mesh with normals, in the image's colours: every triangle lies in the image where that shows more
        of its corners, or of their mirror images; where it shows none, on a stripe of the median colour below.
        """
        size, sides = len(self.view), (mesh.vertices, mesh.vertices * _MIRRORED)
        votes = [self._shown(each)[1][mesh.faces].sum(axis=1) for each in sides]
        way = np.argmax([*votes, np.full(len(mesh.faces), 0.5)], axis=0)
        own, faces = np.unique(way[:, None] * len(mesh.vertices) + mesh.faces, return_inverse=True)
        way, vertex = np.divmod(own, len(mesh.vertices))
        uv = np.tile([size / 2, size + _STRIPE / 2], (len(own), 1))
        for number, each in enumerate(sides):
            uv[way == number] = self._place(each[vertex[way == number]])
        beside, stripe = self.view[..., 3] < OPAQUE, np.broadcast_to(self._usual(), (_STRIPE, size, 3))
        near = ndimage.distance_transform_edt(beside, return_distances=False, return_indices=True)
        picture = Image.fromarray(np.concatenate([self.view[tuple(near)][..., :3], stripe]).astype(np.uint8))
        normals = None if mesh.normals is None else mesh.normals[vertex]
        return textured.glb(Mesh(mesh.vertices[vertex], faces, normals=normals), uv / [size, size + _STRIPE], picture)

    def _place(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 2"]:
        """Column and row, in pixels of the image, real."""
        rotation, centre = cameras.extrinsics(*np.array(self.camera))
        place = np.stack(cameras.project(points * transforms.BENCHMARK_FROM_V1, rotation, centre), axis=-1)
        return place * len(self.view) / cameras.IMAGE_SIZE

    def _shown(self, points: Float[np.ndarray, "n 3"]) -> tuple[UInt8[np.ndarray, "n 3"], Bool[np.ndarray, "n"]]:
        """Colours of the image where points are in it, and which of them it sees."""
        place, (_, centre) = np.floor(self._place(points)).astype(int), cameras.extrinsics(*np.array(self.camera))
        seen = (np.clip(place, 0, len(self.view) - 1) == place).all(axis=1)
        column, row = np.where(seen[:, None], place, 0).T
        pixels = self.view[row, column]
        start = centre / transforms.BENCHMARK_FROM_V1
        ways = points - start
        far = np.linalg.norm(ways, axis=1)
        asked = rays.OrientedPoints(np.broadcast_to(start, points.shape), ways / far[:, None])
        seen &= far <= framed_field.query(self.field, asked, ("depth",))[0]["depth"] + _NEAR
        return pixels[:, :3].copy(), seen & (pixels[:, 3] >= OPAQUE)

    def overlap(self, size: int = 96) -> float:
        """Intersection over union of the field's silhouette, from the image's camera, and the image's own."""
        pixels = cameras.pixel_directions(size, np.zeros(1)).reshape(-1, 3)
        rotation, centre = cameras.extrinsics(*np.array(self.camera))
        ways = pixels @ rotation
        starts = np.broadcast_to(centre / transforms.BENCHMARK_FROM_V1, ways.shape)
        asked = rays.OrientedPoints(starts, ways / np.linalg.norm(ways, axis=1, keepdims=True))
        own = framed_field.query(self.field, asked, ("visibility",))[0]["visibility"] >= framed_field.SEEN
        alpha = np.asarray(Image.fromarray(self.view[..., 3]).resize((size, size), Image.Resampling.BOX))
        given = alpha.ravel() >= OPAQUE
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
