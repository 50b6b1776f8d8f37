"""Unsigned distances and v* of five shapes against exact ones, and their slices. [DDF22] §4.2, app. D, fig. `udf`.

Exact values of the two spheres and of the room are closed forms; those of the meshes are Open3D's closest triangles.
Lengths are those of a shape whose longest side is 2.
"""

import dataclasses
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float

from ddf.data.samples.draws import Surface
from ddf.data.synthetic import showcase
from ddf.fields import checked_cloud, framed_field, scene_field, udf
from ddf.fields.shape_field import ShapeField
from ddf.fit import closest_candidates
from ddf.geometry import raycast, rays
from ddf.geometry.mesh_io import Mesh
from ddf.models import loop_config
from ddf.pictures import field_pictures, picture_strips
from ddf_lab.figures import figure_fields
from ddf_lab.report import pages

NAMES = ("two_spheres", "room", "rabbit", "airliner", "armchair")
POINTS = 1000
NEAR = 0.05  # of the longest side's half: how far from the surface the points near it lie
TURNED_DEG = 30.0
SLICES = {"two_spheres": (0.5,), "rabbit": (0.25, 0.5, 0.75), "armchair": (0.5,)}  # z, of the box
TITLES = {"two_spheres": "two spheres", "room": "room of five planes"}
_SPHERES = 0.4, 1.1  # radius and distance of `showcase.two_spheres`

Nearest = Callable[[Float[np.ndarray, "n 3"]], Float[np.ndarray, "n 3"]]  # positions -> closest points


@dataclass(frozen=True)
class Found:
    """Distances and unit directions, mesh frame; queries a point, and what was paid once."""

    distances: Float[np.ndarray, "n"]
    directions: Float[np.ndarray, "n 3"]
    queries: float
    once: str = "–"


Ask = Callable[[Float[np.ndarray, "n 3"]], Found]  # a way to distances: positions -> what it finds


def to_spheres(positions: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Closest points on the two spheres."""
    radius, apart = _SPHERES
    centres = np.where(positions[:, :1] < 0, -1.0, 1.0) * np.array([apart / 2, 0.0, 0.0])
    away = positions - centres
    return centres + radius * away / np.linalg.norm(away, axis=1, keepdims=True)


def to_room(positions: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Closest points on the five sides of the cube [-1, 1]^3 that is open to +Z; each side is a square."""
    sides = []
    for axis, at in ((0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0), (2, -1.0)):
        onto = np.clip(positions, -1.0, 1.0)
        onto[:, axis] = at
        sides.append(onto)
    squared = np.stack([((side - positions) ** 2).sum(axis=1) for side in sides])
    return np.stack(sides)[squared.argmin(axis=0), np.arange(len(positions))]


def exact(name: str, mesh: Mesh) -> Nearest:
    """Closest points on a shape, in its own frame."""
    closed = {"two_spheres": to_spheres, "room": to_room}
    return closed[name] if name in closed else raycast.Scene(mesh).closest


def mesh_of(name: str) -> Mesh:
    """The mesh that a field was fitted to."""
    return (figure_fields.SHAPES | showcase.SHAPES)[name]()


def section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """Table and slices."""
    rows, cells = [], []
    for name in NAMES:
        field, mesh = figure_fields.fitted(name, config, folder), mesh_of(name)
        nearest, cloud = exact(name, mesh), _cloud(field)
        rows += _rows(name, field, mesh, nearest, _ways(name, field, nearest, cloud, config, folder))
        for level in SLICES.get(name, ()):
            heading = f"{TITLES.get(name, name)}, z at {100 * level:.0f} %"
            cells.append((heading, slices(level, field, nearest, cloud[0], config.picture_size)))
    columns = ("UDF", "exact UDF", "v*", "exact v*")
    strip = [picture_strips.StripRow(heading, (), row) for heading, row in cells]
    header = ["shape", "way", "mean", "near", "v*, °", f"> {TURNED_DEG:g}°, %", "queries", "once"]
    return pages.Section(
        "Unsigned distances and v*",
        [
            pages.Figure(
                "distances.webp",
                "Near is yellow. v* is (x, y, z) as red, green, blue. Its colour changes where the closest point jumps:"
                " on the surface and on the medial surface.",
                "Slices of unsigned distances and of v*, beside the exact ones",
                picture_strips.strip(columns, strip),
            ),
            pages.Table(
                f"|UDF - exact| over {POINTS:,} uniform points of the box, and over as many within {NEAR} of the"
                " surface (near). v*: median angle, and share turned by more. queries: per point; once: per field.",
                header,
                rows,
                labels=2,
            ),
            "Answers [DDF22] §4.2 and app. D. `cloud` is what `Field.udf` and `ddf udf` do.",
        ],
    )


def _cloud(field: ShapeField) -> tuple[checked_cloud.CheckedCloud, str]:
    """The hits, and their cost in words."""
    counted = scene_field.Counted(field)
    started = time.process_time()
    cloud = checked_cloud.draw(counted)
    return cloud, f"{counted.queries / 1000:,.0f} k queries, {time.process_time() - started:.1f} s of a core"


def _rows(name: str, field: ShapeField, mesh: Mesh, nearest: Nearest, ways: Mapping[str, Ask]) -> list[list[str]]:
    """What every way finds at uniform points and near the surface, and its errors."""
    random = np.random.default_rng(0)
    corners = field.field_from_mesh.inverse().apply(np.stack([field.lower, field.upper]))
    unit = 2 / float(np.ptp(mesh.surface_vertices(), axis=0).max())
    uniform = random.uniform(corners[0], corners[1], (POINTS, 3))
    surface, _ = Surface.of(mesh).draw(POINTS, random)
    close = np.clip(surface + random.uniform(-NEAR, NEAR, (POINTS, 3)) / unit / np.sqrt(3), corners[0], corners[1])
    rows = []
    for way, ask in ways.items():
        found, beside = ask(uniform), ask(close)
        errors, near = (unit * _errors(each, at, nearest) for each, at in ((found, uniform), (beside, close)))
        angle = _angles(found, uniform, nearest)
        means = [f"{np.nanmean(errors):.4f}", f"{np.nanmean(near):.4f}"]
        turned = [f"{np.nanmedian(angle):.1f}", f"{100 * np.nanmean(angle > TURNED_DEG):.1f}"]
        rows.append([TITLES.get(name, name), way, *means, *turned, f"{found.queries:g}", found.once])
    return rows


def _ways(
    name: str,
    field: ShapeField,
    nearest: Nearest,
    cloud: tuple[checked_cloud.CheckedCloud, str],
    config: figure_fields.FiguresConfig,
    folder: Path,
) -> dict[str, Ask]:
    """Ways to distances by name; g_v for the shape that it is trained on."""

    def truly(positions: Float[np.ndarray, "n 3"]) -> Found:
        ways = nearest(positions) - positions
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        found, _ = framed_field.query(field, rays.OrientedPoints(positions, ways), ("depth", "visibility"))
        return Found(np.where(found["visibility"] >= udf.SEEN, found["depth"], np.nan), ways, 1)

    def by_cloud(positions: Float[np.ndarray, "n 3"]) -> Found:
        return Found(*cloud[0].distances(positions), 0, cloud[1])

    def by_search(positions: Float[np.ndarray, "n 3"]) -> Found:
        found = udf.search(closest_candidates.asked(field.field), _inside(field, positions))
        return _outside(field, found, 32 + 2 * 4)

    ways = {"along the true v*": truly, "cloud": by_cloud, "search, 32 + 4": by_search}
    if name == "rabbit":
        recipe = candidate_recipe(config)
        network = closest_candidates.fit(field, recipe, folder / "candidates")
        log = np.genfromtxt(folder / "candidates" / "log.csv", delimiter=",", names=True)

        def by_network(positions: Float[np.ndarray, "n 3"]) -> Found:
            inside = _inside(field, positions)
            found = udf.from_candidates(closest_candidates.asked(field.field), inside, network(inside))
            return dataclasses.replace(
                _outside(field, found, network.num_candidates),
                once=f"{recipe.steps:,} steps of {recipe.points:,}, {float(log['seconds'][-1]):.0f} s",
            )

        ways["the paper's g_v"] = by_network
    return ways


def candidate_recipe(config: figure_fields.FiguresConfig) -> closest_candidates.CandidateConfig:
    """g_v in seconds, or as [DDF22] app. D trains it."""
    if config.paper_candidates:
        loop = loop_config.LoopConfig(schedule="constant", threads=1)
        return closest_candidates.CandidateConfig(loop)
    loop = loop_config.LoopConfig(1e-3, "cosine", 0, 1.0, 1)
    return closest_candidates.CandidateConfig(loop, config.candidate_steps, 256, omega_first=3.0)


def _inside(field: ShapeField, positions: Float[np.ndarray, "n 3"]) -> torch.Tensor:
    return torch.from_numpy(field.field_from_mesh.apply(positions)).float()


def _outside(field: ShapeField, found: udf.Closest, queries: float) -> Found:
    """In the frame and the unit of the mesh."""
    back = field.field_from_mesh.inverse()
    distances = found.distances.double().numpy() * back.scale
    ways = back.apply_directions(found.directions.double().numpy())
    return Found(np.where(np.isfinite(distances), distances, np.nan), ways, queries)


def _errors(found: Found, positions: Float[np.ndarray, "n 3"], nearest: Nearest) -> Float[np.ndarray, "n"]:
    return np.abs(found.distances - np.linalg.norm(nearest(positions) - positions, axis=1))


def _angles(found: Found, positions: Float[np.ndarray, "n 3"], nearest: Nearest) -> Float[np.ndarray, "n"]:
    """Degrees between v* and the true one; NaN where nothing is found."""
    true = nearest(positions) - positions
    true /= np.maximum(np.linalg.norm(true, axis=1, keepdims=True), 1e-12)
    cosine = (found.directions * true).sum(axis=1)
    return np.where(np.isfinite(found.distances), np.degrees(np.arccos(np.clip(cosine, -1, 1))), np.nan)


def slices(
    level: float, field: ShapeField, nearest: Nearest, cloud: checked_cloud.CheckedCloud, size: int
) -> list[picture_strips.Picture]:
    """UDF and v* with the exact ones, in a plane z = const, at a share of the box."""
    corners = field.field_from_mesh.inverse().apply(np.stack([field.lower, field.upper]))
    middle, half = corners.mean(axis=0), float(np.ptp(corners, axis=0).max()) / 2
    steps = half * (2 * (np.arange(size) + 0.5) / size - 1)
    y, x = np.meshgrid(-steps, steps, indexing="ij")
    positions = middle + np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    positions[:, 2] = corners[0, 2] + level * np.ptp(corners[:, 2])
    distances, ways = cloud.distances(positions)
    true_ways = nearest(positions) - positions
    true = np.linalg.norm(true_ways, axis=1)
    true_ways /= np.maximum(true, 1e-12)[:, None]
    pictures = field_pictures.depth_pictures(distances.reshape(size, size), true.reshape(size, size))
    seen = np.ones((size, size))
    coloured = [field_pictures.normals_picture(each.reshape(size, size, 3), seen) for each in (ways, true_ways)]
    return [*pictures, *coloured]
