"""Shaded pictures of a field: grey clay or paint on white, with soft shadows on itself and the ground, by its own rays.

The lamp stands above the camera's left shoulder and turns with it. A pixel is one ray, and one more from a part of the
lamp where it faces it; only where neighbours differ (outlines, creases, edges of shadows) it is the mean of nine.
Ambient occlusion, where it is asked for, darkens what is near to other parts, by rays to the sky.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, UInt8
from scipy import ndimage

from ddf.fields import framed_field, scene_field
from ddf.geometry import cameras, rays, transforms
from ddf.pictures import field_pictures

Camera = tuple[float, float, float]  # as of `framed_field.camera_rays`
Colours = Callable[[Float[np.ndarray, "n 3"]], UInt8[np.ndarray, "n 3"]]  # of points on the surface, mesh frame
Window = tuple[float, float, float]  # left, top and side of what is shown, of a camera's whole picture

WHOLE: Window = (0.0, 0.0, 1.0)
_SIDE = 3  # rays a side of a pixel whose neighbours differ
MOST_SAMPLES = _SIDE**2  # a pixel: of two rays, and those to the sky
_LAMP = np.array([-0.55, 0.75, 0.6])  # camera's axes: right, up, backwards
_RADIUS = 0.07  # of the lamp, seen from the object, in radians
_CLAY = np.array([0.80, 0.77, 0.72])
_SKY, _GROUND, _KEY = np.array([0.34, 0.37, 0.42]), np.array([0.17, 0.15, 0.14]), np.array([0.92, 0.89, 0.84])
_GLOSS, _SHARPNESS = 0.08, 24.0
_DARKEST = 0.42  # of the ground's shadow
_CLEAR = 0.03  # of the box's diagonal: what is this near to a point does not shade it
_LIFT, _NEAR = 2e-3, 0.15  # of it: where rays to the sky begin, and how far they look
_BENT = 0.9  # cosine between normals of neighbours, from which on they differ
_FLOOR_RAYS, _WINDOW_RAYS, _MARGIN = 48, 160, 0.05  # a side, all objects together; around what is seen
_LEAST_RAYS = 12  # a side, of an object
_GAMMA = 2.2


@dataclass(frozen=True)
class Standing:
    """A field on the ground. floor: its height along the mesh's axis `up`, above the centre of the box."""

    field: framed_field.FramedField
    up: str
    floor: float

    def axes(self) -> tuple[np.ndarray, np.ndarray]:
        """The box's centre in the mesh's frame, and that frame's x, y (up) and z as columns."""
        to_mesh = self.field.field_from_mesh.inverse()
        return to_mesh.apply((self.field.lower + self.field.upper)[None] / 2)[0], framed_field.upright(self.up)

    def diagonal(self) -> float:
        """Of the box, unit of the mesh."""
        return float(np.linalg.norm(self.field.upper - self.field.lower)) / self.field.field_from_mesh.scale


@dataclass(frozen=True)
class Shaded:
    """A picture, and the share of each of its pixels that sees the object."""

    picture: UInt8[np.ndarray, "size size 3"]
    seen: Float[np.ndarray, "size size"]


def stand(field: framed_field.FramedField, up: str = "y") -> Standing:
    """The field on a ground at its lowest point, which rays from below find; at its box's where these meet nothing."""
    centre, turn = Standing(field, up, 0.0).axes()
    boxes, side = _boxes(field, _FLOOR_RAYS)
    across = _grid(side)
    bottom = min(float(((box - centre) @ turn)[:, 1].min()) for box in boxes)
    bottom, floors = bottom - 1e-3 * abs(bottom), list[float]()
    for box in boxes:
        corners = (box - centre) @ turn
        x, z = (corners.min(0)[[0, 2]] + across * np.ptp(corners, axis=0)[[0, 2]]).T
        starts = np.stack((x, np.full_like(x, bottom), z), -1) @ turn.T + centre
        towards = np.broadcast_to(turn[:, 1], starts.shape)
        depth = framed_field.query(field, rays.OrientedPoints(starts, towards), ("depth",))[0]["depth"]
        if np.isfinite(depth).any():
            floors.append(float(np.percentile(depth[np.isfinite(depth)], 1)))
    return Standing(field, up, bottom + min(floors, default=0.0))


def window(standing: Standing, seen_by: Sequence[Camera]) -> Window:
    """The least part of the picture that holds what any of the cameras sees, with a margin; all where nothing is."""
    boxes, side = _boxes(standing.field, _WINDOW_RAYS)
    grid, found = _grid(side), list[np.ndarray]()
    for camera in seen_by:
        start = _rays(standing, camera, np.zeros(1), np.zeros(1))[0][0]
        for box in boxes:
            low, high = np.zeros(2), np.ones(2)
            if ((box - start) @ _camera_axes(standing, camera)[:, 2] < 0).all():  # it is before the camera
                corners = project(standing, camera, box)
                low, high = corners.min(0).clip(0, 1), corners.max(0).clip(0, 1)
            place = low + grid * (high - low)
            points = rays.OrientedPoints(*_rays(standing, camera, *place.T))
            hits = framed_field.query(standing.field, points, ("visibility",))[0]["visibility"] >= framed_field.SEEN
            cell = (high - low) / side / 2
            found += [place[hits] - cell, place[hits] + cell]
    seen = np.concatenate(found)
    if not len(seen):
        return WHOLE
    low, high = seen.min(0), seen.max(0)
    side = float((high - low).max()) * (1 + 3 * _MARGIN)
    left, top = (low + high - side) / 2
    return float(left) + _MARGIN * side, float(top), side  # the shadow falls to the right


def _grid(side: int) -> Float[np.ndarray, "n 2"]:
    """The middles of side x side equal cells of the unit square: x from the left, y; row by row."""
    steps = (np.arange(side) + 0.5) / side
    return np.stack([each.ravel() for each in np.meshgrid(steps, steps)], -1)


def _boxes(field: framed_field.FramedField, rays_a_side: int) -> tuple[list[Float[np.ndarray, "8 3"]], int]:
    """Corners of the box of each object, frame of the mesh or the scene, and the rays a side that each one takes."""
    if isinstance(field, scene_field.SceneField):
        parts = [(each, to) for each, to in zip(field.fields, field.scene_from_mesh, strict=True)]
    else:
        parts = [(field, transforms.Similarity())]
    corners = [
        to.compose(each.field_from_mesh.inverse()).apply(transforms.box_corners(each.lower, each.upper))
        for each, to in parts
    ]
    return corners, max(_LEAST_RAYS, round(rays_a_side / len(corners) ** 0.5))


def render(
    standing: Standing, camera: Camera, size: int, shown: Window = WHOLE, colours: Colours | None = None, sky: int = 0
) -> Shaded:
    """What one camera sees, of a surface in these colours, clay without; sky: rays of ambient occlusion."""
    framed_field.require_camera(camera, size, standing.up)
    row, column = (each.ravel() for each in np.indices((size, size)))
    first = _Light(standing, camera, shown, size, colours, sky)
    linear, seen, normals, lit = first.at(column + 0.5, row + 0.5, (row % 3) * 3 + column % 3)
    differ = _differ(*(each.reshape(size, size, -1) for each in (normals, lit, seen)))
    right, down = _grid(_SIDE).T
    x, y = column[differ][:, None] + right, row[differ][:, None] + down
    parts = np.broadcast_to(np.arange(_SIDE**2), x.shape)
    finer, finer_seen, _, _ = first.at(x.ravel(), y.ravel(), parts.ravel())
    linear[differ] = finer.reshape(-1, _SIDE**2, 3).mean(1)
    share = seen.astype(float)
    share[differ] = finer_seen.reshape(-1, _SIDE**2).mean(1)
    picture = field_pictures.to_bytes(linear.reshape(size, size, 3) ** (1 / _GAMMA))
    return Shaded(picture, share.reshape(size, size))


def project(standing: Standing, camera: Camera, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 2"]:
    """Where points of the mesh's frame lie in a camera's whole picture: x from the left, y from the top, side 1."""
    start, _ = _rays(standing, camera, np.zeros(1), np.zeros(1))
    return np.stack(cameras.project(points, _camera_axes(standing, camera).T, start[0]), -1) / cameras.IMAGE_SIZE


def camera_rays(standing: Standing, camera: Camera, shown: Window, size: int) -> rays.OrientedPoints[np.ndarray]:
    """Rays of the pixels of a picture, row by row from the top, mesh frame."""
    row, column = (shown[2] * (each.ravel() + 0.5) / size for each in np.indices((size, size)))
    return rays.OrientedPoints(*_rays(standing, camera, shown[0] + column, shown[1] + row))


def _rays(standing: Standing, camera: Camera, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Starts and unit directions, mesh frame; x from the left and y from the top of the camera's picture of side 1."""
    directions = cameras.directions_at(cameras.IMAGE_SIZE * x, cameras.IMAGE_SIZE * y)
    to_mesh = standing.field.field_from_mesh.inverse()
    start, _ = framed_field.camera_rays(standing.field, camera, 1, standing.up)
    starts = np.broadcast_to(to_mesh.apply(start), directions.shape)
    return starts, directions @ _camera_axes(standing, camera).T


def _camera_axes(standing: Standing, camera: Camera) -> Float[np.ndarray, "3 3"]:
    """Right, up and backwards in the mesh's frame, as columns."""
    azimuth, elevation = np.deg2rad(np.array(camera[:2], np.float64))
    return standing.axes()[1] @ cameras.rotation(azimuth, elevation).T


@dataclass(frozen=True)
class _Light:
    """The lamp of one picture."""

    standing: Standing
    camera: Camera
    shown: Window
    size: int
    colours: Colours | None
    sky: int

    def at(
        self, column: np.ndarray, row: np.ndarray, part: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Of rays through the picture: linear colours, what is seen, its normals, whether it is lit."""
        left, top, side = self.shown
        field = self.standing.field
        starts, directions = _rays(
            self.standing, self.camera, left + side * column / self.size, top + side * row / self.size
        )
        found, _ = framed_field.query(field, rays.OrientedPoints(starts, directions), ("depth", "normals"))
        seen = np.isfinite(found["depth"])
        (centre, turn), (middle, parts) = self.standing.axes(), self.lamp()
        normals = found["normals"]
        normals = np.where((normals * directions).sum(-1, keepdims=True) > 0, -normals, normals)
        height = (starts - centre) @ turn[:, 1] - self.standing.floor
        falling = -directions @ turn[:, 1]
        ground = ~seen & (height > 0) & (falling > 1e-6)
        distance = np.where(seen, found["depth"], height / np.where(ground, falling, 1.0))
        places = starts + distance[:, None] * directions
        lit = self.lit(places, parts[part], (seen & (normals @ middle > 0)) | ground)
        colours = np.ones((len(starts), 3))
        colours[ground] -= _DARKEST * ~lit[ground, None]
        surface = rays.surface_points(starts[seen], directions[seen], distance[seen])
        paint = _CLAY if self.colours is None else (self.colours(surface) / 255.0) ** _GAMMA
        free = self.open(surface, normals[seen])
        colours[seen] = _reflected(paint, normals[seen], middle, -directions[seen], turn[:, 1], lit[seen], free)
        return colours, seen, normals, lit

    def lamp(self) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "9 3"]]:
        """Unit directions to the middle of the lamp and to its parts, mesh frame."""
        middle = _LAMP / np.linalg.norm(_LAMP)
        across = np.cross(middle, [0.0, 1.0, 0.0])
        across /= np.linalg.norm(across)
        order = np.arange(_SIDE**2)
        reach, angle = np.sqrt((order + 0.5) / _SIDE**2), order * np.pi * (3 - np.sqrt(5))  # a sunflower's seeds
        aside = np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * np.cross(middle, across)
        parts = middle + _RADIUS * reach[:, None] * aside
        axes = _camera_axes(self.standing, self.camera)
        return axes @ middle, parts / np.linalg.norm(parts, axis=-1, keepdims=True) @ axes.T

    def open(self, points: np.ndarray, normals: np.ndarray) -> Float[np.ndarray, "n"]:
        """Share of rays to the sky, by the cosine to the normal, that meet nothing near; 1 where none are asked for.

        A normal and an even point of the unit sphere add up to such a ray.
        """
        field, diagonal, found = self.standing.field, self.standing.diagonal(), np.ones(len(points))
        for spread in rays.evenly_spread(self.sky):
            ways = normals + 0.999 * spread  # never 0
            ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
            asked = rays.OrientedPoints(points + _LIFT * diagonal * normals, ways)
            found -= (framed_field.query(field, asked, ("depth",))[0]["depth"] < _NEAR * diagonal) / self.sky
        return found

    def lit(self, points: np.ndarray, lamp: np.ndarray, facing: np.ndarray) -> Bool[np.ndarray, "n"]:
        """False where a ray from the lamp ends before the point; only points that face it are asked for.

        From outside, for rays that begin beside a surface are those that a field knows least.
        """
        lit, field, diagonal = np.ones(len(points), bool), self.standing.field, self.standing.diagonal()
        towards = rays.OrientedPoints(points[facing] + 2 * diagonal * lamp[facing], -lamp[facing])
        found, _ = framed_field.query(field, towards, ("depth",))
        lit[facing] = found["depth"] > (2 - _CLEAR) * diagonal
        return lit


def _reflected(
    paint: Float[np.ndarray, "*n 3"],
    normals: Float[np.ndarray, "n 3"],
    lamp: Float[np.ndarray, "3"],
    towards_eye: Float[np.ndarray, "n 3"],
    up: Float[np.ndarray, "3"],
    lit: Bool[np.ndarray, "n"],
    free: Float[np.ndarray, "n"],
) -> Float[np.ndarray, "n 3"]:
    """Linear colours: Lambert's law, light from the sky, and a little gloss about the half vector [Blinn 1977]."""
    above = 0.5 + 0.5 * (normals @ up)[:, None]
    halfway = lamp + towards_eye
    halfway /= np.linalg.norm(halfway, axis=-1, keepdims=True)
    facing, gloss = (lit * np.clip((normals * each).sum(-1), 0, 1) for each in (lamp, halfway))
    light = (_SKY * above + _GROUND * (1 - above)) * free[:, None] + _KEY * facing[:, None]
    return paint * light + _GLOSS * gloss[:, None] ** _SHARPNESS


def _differ(
    normals: Float[np.ndarray, "h w 3"], lit: Bool[np.ndarray, "h w 1"], seen: Bool[np.ndarray, "h w 1"]
) -> Bool[np.ndarray, "n"]:
    """Pixels in whose 3 x 3 neighbours what is seen, what is lit or the normals differ."""
    found = np.zeros(seen.shape[:2], bool)
    for each in (lit[..., 0], seen[..., 0]):
        found |= ndimage.maximum_filter(each, 3) != ndimage.minimum_filter(each, 3)
    for axis in (0, 1):
        bent = (normals * np.roll(normals, 1, axis)).sum(-1) < _BENT
        found |= bent & seen[..., 0] & np.roll(seen[..., 0], 1, axis)
    return found.ravel()
