"""Views of a synthetic shape as 3D-R2N2 has them: 137 x 137 RGBA, transparent background, their cameras.

Ray-cast on one thread, 3 x 3 samples a pixel, only inside the shape's projected box. Alpha is the share of samples that
hit. A pixel that the surface touches without meeting a sample still gets a little alpha, found exactly: a triangle that
overlaps a pixel either covers its samples or has an edge that runs through it. So every surface point projects into
the mask.
"""

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
GAMMA = np.float32(1 / 1.35)  # brightens the half tones; R2N2's renders are not linear either
TOUCHED_ALPHA = 14  # of 255, half of one sample of nine
SHADOW_OFFSET = np.float32(2e-4)  # benchmark units: well over float32 rounding at 0.3, well under the thinnest part


@dataclass(frozen=True)
class View:
    """A camera in the metadata's units: degrees, degrees, benchmark units; and the light's place."""

    azimuth_deg: float
    elevation_deg: float
    ratio: float
    light_turn_deg: float = 40.0
    light_height_deg: float = 55.0


class Renderer:
    """A shape prepared for ray casting."""

    def __init__(self, shape: Shape) -> None:
        vertices = shape.vertices * transforms.BENCHMARK_FROM_V1
        self._shape = shape
        self._vertices = vertices
        self._edges = _edges(shape.triangles)
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
        _mark_touched(block, pixels[self._edges.vertices] - low, self._shape.colours[self._edges.face])
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
        rgb = np.clip(linear, 0, 1) ** GAMMA
        pixels = np.concatenate([rgb, hit.mean(axis=1, dtype=np.float32)[:, None]], axis=1)
        return (pixels * 255 + 0.5).astype(np.uint8).reshape(height, width, 4)

    def _shade(self, view: View, hits: "_Hits") -> tuple[Float32[np.ndarray, "n 3"], Bool[np.ndarray, "n"]]:
        """Linear colours, and which points lie in shadow.

        Two-sided: sky and ground, a key light with a shadow, a weak light at the camera, and a highlight.
        """
        directions = hits.rays[:, 3:] / np.sqrt(_dot(hits.rays[:, 3:], hits.rays[:, 3:]))[:, None]
        corners, u, v = self._shape.normals[hits.triangles], hits.uvs[:, :1], hits.uvs[:, 1:]
        normals = (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
        facing = _dot(normals, directions)
        normals *= (-np.sign(facing) / np.sqrt(np.maximum(_dot(normals, normals), 1e-12)))[:, None]  # degenerate: 0
        light = _light(view)
        lit = normals @ light
        shadow = lit <= 0
        toward = np.flatnonzero(~shadow)
        starts = hits.rays[toward, :3] + hits.depth[toward, None] * hits.rays[toward, 3:]
        shadow_rays = np.zeros((len(toward), 6), dtype=np.float32)
        shadow_rays[:, :3] = starts + SHADOW_OFFSET * normals[toward]
        shadow_rays[:, 3:] = light
        shadow[toward] = self._scene.test_occlusions(_tensor(shadow_rays), nthreads=1).numpy()
        key = np.where(shadow, np.float32(0.1), np.float32(1.0)) * np.maximum(lit, 0)
        diffuse = 0.25 + 0.11 * normals[:, 1] + 0.54 * key + 0.13 * np.abs(_dot(normals, directions))
        half = light - directions
        shine = np.maximum(_dot(normals, half), 0) / np.sqrt(_dot(half, half))
        shine = np.where(shadow, np.float32(0), shine**2)
        for _ in range(4):
            shine *= shine  # to the 32nd power in all
        colour = self._shape.colours[hits.triangles] * diffuse[:, None]
        colour += (0.45 * self._shape.gloss[hits.triangles] * shine)[:, None]
        return np.clip(colour, 0, 1), shadow


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


def _light(view: View) -> Float[np.ndarray, "3"]:
    """Unit vector to the key light, which moves with the camera: it says nothing about the shape's own heading."""
    turn, height = np.radians([view.azimuth_deg + view.light_turn_deg, view.light_height_deg])
    return np.array([np.cos(height) * np.cos(turn), np.sin(height), np.cos(height) * np.sin(turn)], dtype=np.float32)


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


@dataclass(frozen=True)
class _Edges:
    """Unique edges, and one of the triangles of each."""

    vertices: Int[np.ndarray, "e 2"]
    face: Int[np.ndarray, "e"]


def _edges(triangles: Int[np.ndarray, "m 3"]) -> _Edges:
    """Every undirected edge once."""
    pairs = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, first = np.unique(pairs, axis=0, return_index=True)
    return _Edges(unique, first // 3)


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
    block[rows, columns, :3] = np.clip(colours[owner] * 0.8, 0, 1) ** GAMMA * 255 + 0.5
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
