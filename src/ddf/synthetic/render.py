"""Views of a synthetic shape as 3D-R2N2 has them: 137 x 137 RGBA, transparent background, the cameras of `ddf.cameras`.

Ray-cast on one thread, 3 x 3 samples a pixel, only inside the shape's projected box. Alpha is the share of samples that
hit. A pixel that the surface touches without meeting a sample still gets a little alpha, found exactly: a triangle that
overlaps a pixel either covers its samples or has an edge that runs through it. So every surface point projects into the mask.
"""

from dataclasses import dataclass

import numpy as np
import open3d as o3d
import torch
from jaxtyping import Float, Int, UInt8

from ddf import cameras, transforms
from ddf.synthetic.assemble import Shape

SUPERSAMPLING = 3
TOUCHED_ALPHA = 14  # of 255, half of one sample of nine
SHADOW_OFFSET = 2e-4  # benchmark units: well over float32 rounding at 0.3, well under the thinnest part


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
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        self._scene.add_triangles(
            np.ascontiguousarray(vertices, dtype=np.float32), np.ascontiguousarray(shape.triangles, dtype=np.uint32)
        )

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
        """The pixels between two corners, from 3 x 3 samples each."""
        s = SUPERSAMPLING
        width, height = (high - low) * s
        u = (np.arange(width, dtype=np.float32) + 0.5) / s + low[0] - cameras.CENTRE_PX
        v = (np.arange(height, dtype=np.float32) + 0.5) / s + low[1] - cameras.CENTRE_PX
        rays = np.zeros((height, width, 6), dtype=np.float32)
        rays[..., :3] = centre
        x_row, y_row, z_row = rotation.astype(np.float32)
        rays[..., 3:] = (u / cameras.FOCAL_PX)[:, None] * x_row - (v / cameras.FOCAL_PX)[:, None, None] * y_row - z_row
        rays[..., 3:] /= np.linalg.norm(rays[..., 3:], axis=-1, keepdims=True)
        flat = rays.reshape(-1, 6)
        answer = self._scene.cast_rays(o3d.core.Tensor(flat), nthreads=1)
        depth = answer["t_hit"].numpy()
        hit = np.flatnonzero(np.isfinite(depth))
        colour = self._shade(
            view, flat[hit], depth[hit], answer["primitive_ids"].numpy()[hit], answer["primitive_uvs"].numpy()[hit]
        )
        samples = np.zeros((len(flat), 4), dtype=np.float32)
        samples[hit, :3] = colour
        samples[hit, 3] = 1.0
        sums = samples.reshape(height // s, s, width // s, s, 4).sum(axis=(1, 3))
        rgb = sums[..., :3] / np.maximum(sums[..., 3:], 1.0)
        return (np.concatenate([rgb, sums[..., 3:] / s**2], axis=-1) * 255 + 0.5).astype(np.uint8)

    def _shade(
        self, view: View, rays: np.ndarray, depth: np.ndarray, triangle: np.ndarray, uv: np.ndarray
    ) -> Float[np.ndarray, "n 3"]:
        """Two-sided shading: sky and ground, a key light with shadow, a weak light at the camera, a highlight; then gamma."""
        directions = rays[:, 3:]
        corners = self._shape.normals[triangle]
        normals = (
            corners[:, 0] + uv[:, :1] * (corners[:, 1] - corners[:, 0]) + uv[:, 1:] * (corners[:, 2] - corners[:, 0])
        )
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        facing = np.einsum("ij,ij->i", normals, directions)
        normals *= -np.sign(facing)[:, None]
        light = _light(view)
        lit = normals @ light
        shadow = np.zeros(len(lit), dtype=bool)
        toward = np.flatnonzero(lit > 0)
        starts = rays[toward, :3] + depth[toward, None] * directions[toward] + SHADOW_OFFSET * normals[toward]
        shadow_rays = np.concatenate([starts, np.broadcast_to(light, starts.shape)], axis=1).astype(np.float32)
        shadow[toward] = self._scene.test_occlusions(o3d.core.Tensor(shadow_rays), nthreads=1).numpy()
        key = np.where(shadow, 0.12, 1.0) * np.maximum(lit, 0)
        ambient = 0.36 + 0.14 * normals[:, 1]
        diffuse = ambient + 0.62 * key + 0.2 * np.abs(facing)
        half = light - directions
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        shine = np.where(shadow, 0.0, np.maximum(np.einsum("ij,ij->i", normals, half), 0) ** 40)
        colour = (
            self._shape.colours[triangle] * diffuse[:, None] + (0.45 * self._shape.gloss[triangle] * shine)[:, None]
        )
        return np.clip(colour, 0, 1) ** np.float32(1 / 1.35)


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
    """Give a little alpha to empty pixels that an edge runs through, in place; `ends` are (u, v) in the block's pixels."""
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
    columns, rows, owner = _traverse(ends[near])
    kept = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    columns, rows, owner = columns[kept], rows[kept], near[owner[kept]]
    free = block[rows, columns, 3] == 0
    columns, rows, owner = columns[free], rows[free], owner[free]
    block[rows, columns, :3] = np.clip(colours[owner] * 0.8, 0, 1) ** (1 / 1.35) * 255 + 0.5
    block[rows, columns, 3] = TOUCHED_ALPHA


def _traverse(ends: Float[np.ndarray, "e 2 2"]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
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
