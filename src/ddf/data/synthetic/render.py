"""Views of a synthetic shape as 3D-R2N2 has them: 137 x 137 RGBA, transparent background, their cameras.

Ray-cast on one thread, 3 x 3 samples a pixel, only inside the shape's projected box. Alpha is the share of samples that
hit. A pixel that the surface touches without meeting a sample still gets a little alpha, found exactly: a triangle that
overlaps a pixel either covers its samples or has an edge that runs through it. So every surface point projects into
the mask.

The light is that of the renders or a key light with a shadow. The lamps of the renders stand on both sides of a shape,
45 degrees up, and never move: toward (0, 1, 1) and (0, 1, -1), Y up. Each gives e (1 + n·l)/2 of its light, so both
together give e (1 + n_y/√2): tops are bright, sides alike, no shadow is cast. A key light moves with the camera and
says nothing about the shape's own heading.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import open3d as o3d
import torch
from jaxtyping import Bool, Float, Float32, Int, UInt8, UInt32

from ddf.data.synthetic.assemble import Shape
from ddf.geometry import cameras, transforms

SUPERSAMPLING = 3  # in each direction; odd, so that a pixel's centre is one of its samples
SAMPLES = SUPERSAMPLING**2
TOUCHED_ALPHA = 14  # of 255, half of one sample of nine
SHADOW_OFFSET = np.float32(2e-4)  # benchmark units: well over float32 rounding at 0.3, well under the thinnest part


LAMPS = np.array([[0, 1, 1], [0, 1, -1]], dtype=np.float32) / np.float32(np.sqrt(2))
LAMP_SHARE = 0.6  # of the views: lit as the renders are
SHADE = np.float32(0.1)  # of the key light, where it is in shadow

Vectors = Float32[np.ndarray, "n 3"]
Numbers = Float32[np.ndarray, "n"]
# Whether points of the given indices, whose normals face the light, are hidden from a light in the direction.
Occluded = Callable[[np.ndarray, Float32[np.ndarray, "3"]], Bool[np.ndarray, "k"]]


@dataclass(frozen=True)
class Light:
    """What falls on a shape in one view.

    lamps: e of the hemispherical lamps; 0.7 in the renders. key: strength of the key light; 0 casts no shadow rays.
    turn_deg, height_deg: the key light's azimuth from the camera's, and elevation. sky: light from everywhere. above:
    how much brighter it is from there than from the side. front: light from the camera. gamma: of the picture.
    """

    lamps: float = 0.0
    key: float = 0.54
    turn_deg: float = 40.0
    height_deg: float = 55.0
    sky: float = 0.25
    above: float = 0.11
    front: float = 0.13
    gamma: float = 1.35


STUDIO = Light()  # one key light, as good as any


def draw_light(rng: np.random.Generator, turn_deg: float, height_deg: float) -> Light:
    """The light of one view: mostly the lamps of the renders, else a key light of any strength."""
    gamma = float(rng.uniform(1.6, 2.2))
    if rng.random() < LAMP_SHARE:
        return Light(lamps=float(rng.uniform(0.5, 0.8)), key=0.0, sky=0.0, above=0.0, front=0.0, gamma=gamma)
    spans = {"key": (0.25, 0.6), "sky": (0.15, 0.4), "above": (0.0, 0.15), "front": (0.0, 0.25)}
    strengths = {name: float(rng.uniform(*span)) for name, span in spans.items()}
    return Light(turn_deg=turn_deg, height_deg=height_deg, gamma=gamma, **strengths)


def illuminate(
    light: Light, camera_azimuth_deg: float, normals: Vectors, directions: Vectors, hardness: Numbers, hidden: Occluded
) -> tuple[Numbers, Numbers, Bool[np.ndarray, "n"]]:
    """Diffuse light, highlight (Blinn's half-way vector to the power `hardness`) and which points lie in shadow.

    Args:
      normals: unit, facing the viewer. directions: unit, from the viewer.
    """
    level = normals[:, 1]
    diffuse = np.float32(light.sky) + np.float32(light.above) * level
    diffuse += np.float32(light.front) * np.abs(np.einsum("ij,ij->i", normals, directions))
    shine, shadow = np.zeros_like(diffuse), np.zeros(len(diffuse), dtype=bool)
    if light.lamps:
        diffuse += np.float32(light.lamps) * (1 + level / np.float32(np.sqrt(2)))
        for lamp in LAMPS:
            shine += np.float32(light.lamps) * (0.5 + 0.5 * _half_way(lamp, normals, directions)) ** hardness
    if light.key:
        towards = _direction(camera_azimuth_deg + light.turn_deg, light.height_deg)
        lit = normals @ towards
        shadow = lit <= 0
        facing = np.flatnonzero(~shadow)
        shadow[facing] = hidden(facing, towards)
        diffuse += np.float32(light.key) * np.where(shadow, SHADE, np.float32(1)) * np.maximum(lit, 0)
        glint = np.maximum(_half_way(towards, normals, directions), 0) ** hardness
        shine += np.where(shadow, np.float32(0), glint)
    return diffuse, shine, shadow


def _half_way(light: Float32[np.ndarray, "3"], normals: Vectors, directions: Vectors) -> Numbers:
    """Cosine between the normal and the half-way vector of light and viewer."""
    half = light - directions
    lengths = np.sqrt(np.maximum(np.einsum("ij,ij->i", half, half), np.float32(1e-12)))  # looking along the light: 0
    return np.einsum("ij,ij->i", normals, half) / lengths


def _direction(azimuth_deg: float, height_deg: float) -> Float32[np.ndarray, "3"]:
    """Unit vector, Y up."""
    turn, height = np.radians([azimuth_deg, height_deg])
    return np.array([np.cos(height) * np.cos(turn), np.sin(height), np.cos(height) * np.sin(turn)], dtype=np.float32)


@dataclass(frozen=True)
class View:
    """A camera in the metadata's units: degrees, degrees, benchmark units; and the light."""

    azimuth_deg: float
    elevation_deg: float
    ratio: float
    light: Light = STUDIO

    def picture(self, linear: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Linear colours as they are shown, in [0, 1]."""
        return np.clip(linear, 0, 1) ** np.float32(1 / self.light.gamma)


class Renderer:
    """A shape prepared for ray casting."""

    def __init__(self, shape: Shape) -> None:
        vertices = shape.vertices * transforms.BENCHMARK_FROM_V1
        self._shape = shape
        self._vertices = vertices
        self._edges, self._edge_face = _edges(shape.triangles)
        self._labels = _labels(shape)
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        self._scene.add_triangles(_tensor(vertices.astype(np.float32)), _tensor(shape.triangles.astype(np.uint32)))

    def render(self, view: View) -> UInt8[np.ndarray, "137 137 4"]:
        """One image, straight (not premultiplied) alpha, RGB 0 where alpha is 0."""
        rotation, centre = _extrinsics(view)
        pixels = _project(self._vertices, rotation, centre)
        size = cameras.IMAGE_SIZE
        low = np.clip(np.floor(pixels.min(axis=0)).astype(int), 0, size)
        high = np.clip(np.floor(pixels.max(axis=0)).astype(int) + 1, 0, size)
        image = np.zeros((size, size, 4), dtype=np.uint8)
        if (high <= low).any():
            return image
        block = image[low[1] : high[1], low[0] : high[0]]
        block[:] = self._block(view, rotation, centre, low, high)
        edge_colours = view.picture(0.8 * self._shape.colours[self._edge_face])
        _mark_touched(block, pixels[self._edges] - low, edge_colours)
        return image

    def _block(
        self, view: View, rotation: np.ndarray, centre: np.ndarray, low: np.ndarray, high: np.ndarray
    ) -> UInt8[np.ndarray, "h w 4"]:
        """The pixels between two corners: all samples are cast; even pixels are shaded once, others per sample."""
        width, height = (high - low).tolist()
        rays = _rays(rotation, centre, low, (height, width))
        answer = self._scene.cast_rays(_tensor(rays), nthreads=1)
        hits = _Hits(rays, *(answer[name].numpy() for name in ("t_hit", "primitive_ids", "primitive_uvs")))
        hit = np.isfinite(hits.depth).reshape(-1, SAMPLES)
        labels = np.where(hit, self._labels[np.minimum(hits.triangles, len(self._labels) - 1)].reshape(hit.shape), -1)
        even = (labels == labels[:, :1]).all(axis=1)
        linear = np.zeros((height * width, 3), dtype=np.float32)
        single = np.flatnonzero(even & hit[:, 0])
        linear[single], shadow = self._shade(view, hits.pick(single * SAMPLES + SAMPLES // 2))
        edge = _differs(single, shadow, height, width)
        several = np.flatnonzero((~even | edge) & hit.any(axis=1))
        samples = np.flatnonzero(hit[several])
        sums = np.zeros((len(several) * SAMPLES, 3), dtype=np.float32)
        sums[samples], _ = self._shade(view, hits.pick(several[samples // SAMPLES] * SAMPLES + samples % SAMPLES))
        counts = hit[several].sum(axis=1, keepdims=True)
        linear[several] = sums.reshape(-1, SAMPLES, 3).sum(axis=1) / counts
        pixels = np.concatenate([view.picture(linear), hit.mean(axis=1, dtype=np.float32)[:, None]], axis=1)
        return (pixels * 255 + 0.5).astype(np.uint8).reshape(height, width, 4)

    def _shade(self, view: View, hits: "_Hits") -> tuple[Float32[np.ndarray, "n 3"], Bool[np.ndarray, "n"]]:
        """Linear colours, and which points lie in shadow; both sides of a surface look alike."""
        directions = hits.rays[:, 3:] / np.sqrt(_dot(hits.rays[:, 3:], hits.rays[:, 3:]))[:, None]
        corners, u, v = self._shape.normals[hits.triangles], hits.uvs[:, :1], hits.uvs[:, 1:]
        normals = (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
        facing = _dot(normals, directions)
        normals *= (-np.sign(facing) / np.sqrt(np.maximum(_dot(normals, normals), 1e-12)))[:, None]  # degenerate: 0
        places = hits.rays[:, :3] + hits.depth[:, None] * hits.rays[:, 3:]

        def hidden(rows: np.ndarray, towards: np.ndarray) -> np.ndarray:
            rays = np.zeros((len(rows), 6), dtype=np.float32)
            rays[:, :3] = places[rows] + SHADOW_OFFSET * normals[rows]
            rays[:, 3:] = towards
            return self._scene.test_occlusions(_tensor(rays), nthreads=1).numpy()

        hardness = self._shape.hardness[hits.triangles]
        diffuse, shine, shadow = illuminate(view.light, view.azimuth_deg, normals, directions, hardness, hidden)
        colour = self._colours(hits, places) * diffuse[:, None]
        colour += (0.45 * self._shape.gloss[hits.triangles] * shine)[:, None]
        return np.clip(colour, 0, 1), shadow

    def _colours(self, hits: "_Hits", places: Float32[np.ndarray, "n 3"]) -> Float32[np.ndarray, "n 3"]:
        """Linear colours of the paints with their textures and pictures, at places in benchmark units."""
        colours, texture = self._shape.colours[hits.triangles], self._shape.texture[hits.triangles]
        for number, worn in enumerate(self._shape.textures):
            rows = np.flatnonzero(texture == number)
            share = worn.shares(places[rows] / np.float32(transforms.BENCHMARK_FROM_V1))[:, None]
            colours[rows] += share * (np.array(worn.colour, dtype=np.float32) - colours[rows])
        if over := self._shape.covering:
            for number, picture in enumerate(over.pictures):
                rows = np.flatnonzero(over.number[hits.triangles] == number)
                u, v = hits.uvs[rows, :1], hits.uvs[rows, 1:]
                first, second, third = over.uvs[hits.triangles[rows]].transpose(1, 0, 2)
                inside = (1 - u - v) * first + u * second + v * third
                colours[rows] = picture.colours(inside, over.level[hits.triangles[rows]])
        return colours


@dataclass(frozen=True)
class _Hits:
    """What rays met; the entries of rays that met nothing mean nothing."""

    rays: Float32[np.ndarray, "n 6"]
    depth: Float32[np.ndarray, "n"]
    triangles: UInt32[np.ndarray, "n"]
    uvs: Float32[np.ndarray, "n 2"]

    def pick(self, rows: Int[np.ndarray, "k"]) -> "_Hits":
        """Some of them."""
        return _Hits(self.rays[rows], self.depth[rows], self.triangles[rows], self.uvs[rows])


def _tensor(array: Any) -> o3d.core.Tensor:
    """Open3D's tensor of an array; its stubs do not know arrays."""
    return o3d.core.Tensor(np.ascontiguousarray(array))  # pyright: ignore[reportCallIssue]


def _dot(a: Float32[np.ndarray, "n 3"], b: Float32[np.ndarray, "n 3"]) -> Float32[np.ndarray, "n"]:
    """Products row by row."""
    return np.einsum("ij,ij->i", a, b)


def _rays(
    rotation: np.ndarray, centre: np.ndarray, low: np.ndarray, shape: tuple[int, int]
) -> Float32[np.ndarray, "n 6"]:
    """Camera rays, directions not normalised, pixel after pixel with its samples in rows."""
    height, width = shape
    inner = (np.arange(SUPERSAMPLING) + 0.5) / SUPERSAMPLING
    u = ((np.arange(width)[:, None] + inner + low[0] - cameras.CENTRE_PX) / cameras.FOCAL_PX).astype(np.float32)
    v = ((np.arange(height)[:, None] + inner + low[1] - cameras.CENTRE_PX) / cameras.FOCAL_PX).astype(np.float32)
    right, up, backwards = rotation.astype(np.float32)
    rays = np.zeros((height, width, SUPERSAMPLING, SUPERSAMPLING, 6), dtype=np.float32)
    rays[..., :3] = centre
    for k in range(3):
        across, down = u * right[k] - backwards[k], v * up[k]
        rays[..., 3 + k] = across[None, :, None, :] - down[:, None, :, None]
    return rays.reshape(-1, 6)


def _differs(
    pixels: Int[np.ndarray, "n"], flags: Bool[np.ndarray, "n"], height: int, width: int
) -> Bool[np.ndarray, "pixels"]:
    """Pixels whose flag is not that of a neighbour beside, above or below; pixels without a flag are unlike all."""
    image = np.full((height, width), 2, dtype=np.uint8)
    image.flat[pixels] = flags
    unlike = np.zeros((height, width), dtype=bool)
    for axis in range(2):
        change = np.diff(image, axis=axis) != 0
        first, last = (change, np.zeros_like(change[:1])) if axis == 0 else (change, np.zeros_like(change[:, :1]))
        unlike |= np.concatenate([first, last], axis=axis) | np.concatenate([last, first], axis=axis)
    return unlike.ravel()


def _extrinsics(view: View) -> tuple[np.ndarray, np.ndarray]:
    """R and cam of `cameras.extrinsics` as float64 arrays."""
    angles = torch.deg2rad(torch.tensor([view.azimuth_deg, view.elevation_deg], dtype=torch.float64))
    rotation, centre = cameras.extrinsics(angles[0], angles[1], torch.tensor(view.ratio, dtype=torch.float64))
    return rotation.numpy(), centre.numpy()


def _project(vertices: Float[np.ndarray, "n 3"], rotation: np.ndarray, centre: np.ndarray) -> Float[np.ndarray, "n 2"]:
    """`cameras.project` for arrays."""
    u, v = cameras.project(torch.from_numpy(vertices), torch.from_numpy(rotation), torch.from_numpy(centre))
    return torch.stack((u, v), dim=-1).numpy()


def _labels(shape: Shape) -> Int[np.ndarray, "m"]:
    """One number per triangle, equal within a part where the surface faces about the same way."""
    part = np.repeat(np.arange(len(shape.parts)), [count for _, count in shape.parts])
    return part * 1000 + (np.rint(3 * shape.normals.mean(axis=1)) + 3).astype(int) @ np.array([100, 10, 1])


def _edges(triangles: Int[np.ndarray, "m 3"]) -> tuple[Int[np.ndarray, "e 2"], Int[np.ndarray, "e"]]:
    """Every undirected edge once, and one of the triangles of each."""
    pairs = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, first = np.unique(pairs, axis=0, return_index=True)
    return unique, first // 3


def _mark_touched(
    block: UInt8[np.ndarray, "h w 4"], ends: Float[np.ndarray, "e 2 2"], colours: Float[np.ndarray, "e 3"]
) -> None:
    """Give a little alpha to empty pixels that an edge runs through, in place; `ends`: (u, v) in the block's pixels."""
    height, width = block.shape[:2]
    cells = np.clip(np.floor(ends).astype(int), 0, [width - 1, height - 1])
    low, high = cells.min(axis=1), cells.max(axis=1) + 1
    empty = np.zeros((height + 1, width + 1), dtype=np.int32)  # how many empty pixels lie above and left of a corner
    empty[1:, 1:] = (block[..., 3] == 0).cumsum(axis=0).cumsum(axis=1)
    inside = (
        empty[high[:, 1], high[:, 0]]
        - empty[low[:, 1], high[:, 0]]
        - empty[high[:, 1], low[:, 0]]
        + empty[low[:, 1], low[:, 0]]
    )
    near = np.flatnonzero(inside)
    columns, rows, owner = traverse(ends[near])
    kept = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    columns, rows, owner = columns[kept], rows[kept], near[owner[kept]]
    free = block[rows, columns, 3] == 0
    columns, rows, owner = columns[free], rows[free], owner[free]
    block[rows, columns, :3] = colours[owner] * 255 + 0.5
    block[rows, columns, 3] = TOUCHED_ALPHA


def traverse(ends: Float[np.ndarray, "e 2 2"]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Columns and rows of all pixels that the segments run through, and which segment it was; pixels may come twice."""
    count = len(ends)
    owners, times = [np.arange(count), np.arange(count)], [np.zeros(count), np.ones(count)]
    for axis in range(2):
        start, end = ends[:, 0, axis], ends[:, 1, axis]
        first = np.floor(np.minimum(start, end)) + 1
        crossings = np.maximum(np.floor(np.maximum(start, end)) - first + 1, 0).astype(int)
        owner = np.repeat(np.arange(count), crossings)
        line = first[owner] + np.arange(len(owner)) - np.repeat(np.cumsum(crossings) - crossings, crossings)
        owners.append(owner)
        times.append((line - start[owner]) / (end - start)[owner])
    owner, time = np.concatenate(owners), np.concatenate(times)
    order = np.lexsort((time, owner))
    owner, time = owner[order], time[order]
    same = owner[1:] == owner[:-1]
    owner, middle = owner[1:][same], ((time[1:] + time[:-1]) / 2)[same]
    places = np.floor(ends[owner, 0] + middle[:, None] * (ends[owner, 1] - ends[owner, 0])).astype(int)
    return places[:, 0], places[:, 1], owner
