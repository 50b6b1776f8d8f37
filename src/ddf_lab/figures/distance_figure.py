"""Unsigned distances and v* of five shapes against exact ones, and their slices. [DDF22] §4.2, app. D, fig. `udf`.

Exact values of the two spheres are a closed form; those of the meshes are Open3D's closest triangles.
Lengths are those of a shape whose longest side is 2.
"""

import functools
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from ddf.data.samples.draws import Surface
from ddf.data.synthetic import showcase
from ddf.fields import checked_cloud, framed_field, scene_field, udf
from ddf.fields.shape_field import ShapeField
from ddf.fit import closest_candidates
from ddf.geometry import raycast, rays
from ddf.geometry.mesh_io import Mesh
from ddf.models import loop_config
from ddf.pictures import field_pictures, picture_strips
from ddf.training import training_loop
from ddf_lab.figures import figure_fields
from ddf_lab.report import beside, pages

NAMES = ("two_spheres", "room", "rabbit", "airliner", "armchair")
POINTS = 1000
NEAR = 0.05  # of the longest side's half: how far from the surface the points near it lie
TURNED_DEG = 30.0
SOFT = (0.05, 0.5)  # η_T of the soft minimum
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


def exact(name: str, mesh: Mesh) -> Nearest:
    """Closest points on a shape, in its own frame."""
    return to_spheres if name == "two_spheres" else raycast.Scene(mesh).closest


def section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """Table and slices."""
    rows, strip = [], []
    for name in NAMES:
        field, mesh = figure_fields.fitted(name, config, folder), (figure_fields.SHAPES | showcase.SHAPES)[name]()
        nearest, counted, started = exact(name, mesh), scene_field.Counted(field), time.process_time()
        cloud = checked_cloud.draw(counted)
        cost = f"{counted.queries / 1000:,.0f} k queries, {time.process_time() - started:.1f} s of a core"
        ways = _ways(field, nearest, cloud, cost)
        if name == "rabbit":
            ways |= _network(field, config, folder / "candidates")
        rows += _rows(TITLES.get(name, name), field, mesh, nearest, ways)
        for level in SLICES.get(name, ()):
            heading = f"{TITLES.get(name, name)}, z at {100 * level:.0f} %"
            cells = slices(level, field, nearest, cloud, config.picture_size)
            strip.append(picture_strips.StripRow(heading, (), cells))
    figure = pages.Figure(
        "distances.webp",
        "Near is yellow. v* is (x, y, z) as red, green, blue. Its colour changes where the closest point jumps: on the"
        " surface and on the medial surface.",
        "Slices of unsigned distances and of v*, beside the exact ones",
        picture_strips.strip(("UDF", "exact UDF", "v*", "exact v*"), strip),
    )
    table = pages.Table(
        f"|UDF - exact| at those of {POINTS:,} points, of the box or within {NEAR} of the surface (near), that find"
        " one. v*: median angle, and share turned by more. queries: per point; once: per field.",
        ["shape", "way", "mean", "near", "v*, °", f"> {TURNED_DEG:g}°, %", "queries", "once"],
        rows,
        labels=2,
    )
    said = (
        "Answers [DDF22] §4.2 and app. D. `cloud` is what `Field.udf` does of networks. g_v, soft: the paper's means of"
        " depths and of candidates, at all points; it gives no η_T. Least: of candidates that see one, with v*"
        f" of η_T = {udf.TEMPERATURE:g}, not the paper's. ε_s = {udf.INVERSE_DEPTH:g}."
    )
    return pages.Section("Unsigned distances and v*", [figure, table, said])


def _rows(title: str, field: ShapeField, mesh: Mesh, nearest: Nearest, ways: Mapping[str, Ask]) -> list[list[str]]:
    """What every way finds at uniform points and near the surface, and its errors."""
    random, (low, high) = np.random.default_rng(0), beside.corners(field)
    unit = 2 / float(np.ptp(mesh.surface_vertices(), axis=0).max())
    uniform = random.uniform(low, high, (POINTS, 3))
    surface, _ = Surface.of(mesh).draw(POINTS, random)
    close = np.clip(surface + random.uniform(-NEAR, NEAR, (POINTS, 3)) / unit / np.sqrt(3), low, high)
    rows = []
    for way, ask in ways.items():
        found = ask(uniform)
        (errors, angle), (near, _) = _errors(found, uniform, nearest), _errors(ask(close), close, nearest)
        means = [f"{unit * np.nanmean(each):.4f}" for each in (errors, near)]
        turned = [f"{np.nanmedian(angle):.1f}", f"{100 * np.nanmean(angle > TURNED_DEG):.1f}"]
        rows.append([title, way, *means, *turned, f"{found.queries:g}", found.once])
    return rows


def _ways(field: ShapeField, nearest: Nearest, cloud: checked_cloud.CheckedCloud, cost: str) -> dict[str, Ask]:
    """Ways to distances by name, but for g_v, which is trained."""

    def truly(positions: Float[np.ndarray, "n 3"]) -> Found:
        ways = nearest(positions) - positions
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        found, _ = framed_field.query(field, rays.OrientedPoints(positions, ways), ("depth",))
        return Found(np.where(np.isfinite(found["depth"]), found["depth"], np.nan), ways, 1)

    return {
        "along the true v*": truly,
        "cloud": lambda positions: Found(*cloud.distances(positions), 0, cost),
    }


def _network(field: ShapeField, config: figure_fields.FiguresConfig, folder: Path) -> dict[str, Ask]:
    """The ways of g_v."""
    recipe, back = candidate_recipe(config), field.field_from_mesh.inverse()
    network = closest_candidates.fit(field, recipe, folder)
    took = training_loop.read_log(folder)[-1]["seconds"]
    asked, once = closest_candidates.asked(field.field), f"{recipe.steps:,} steps of {recipe.points:,}, {took:.0f} s"

    def ask(positions: Float[np.ndarray, "n 3"], blend: scene_field.Blend | None = None) -> Found:
        inside = torch.from_numpy(field.field_from_mesh.apply(positions)).float()
        found = from_candidates(asked, inside, network(inside), blend)
        distances = found.distances.double().numpy() * back.scale
        ways = back.apply_directions(found.directions.double().numpy())
        return Found(np.where(np.isfinite(distances), distances, np.nan), ways, udf.NUM_CANDIDATES, once)

    ways: dict[str, Ask] = {"the paper's g_v, least depth": ask}
    for each in SOFT:
        blend = scene_field.Blend(each, udf.INVERSE_DEPTH)
        ways[f"the paper's g_v, soft, η_T = {each:g}"] = functools.partial(ask, blend=blend)
    return ways


@torch.no_grad()
def from_candidates(
    ask: udf.Ask, positions: Float[Tensor, "n 3"], candidates: Float[Tensor, "n k 3"], blend: scene_field.Blend | None
) -> udf.Closest:
    """As `udf.from_candidates`, or with a blend the paper's Σ w_i d_i and the unit vector along Σ w_i v_i."""
    if blend is None:
        return udf.from_candidates(ask, positions, candidates)
    answer = ask(positions.unsqueeze(-2).expand_as(candidates), candidates, False)
    found, weights = scene_field.compose(answer.visibility.T.numpy(), answer.depth.T.numpy(), blend)
    mean = (torch.from_numpy(weights).T[..., None] * candidates).sum(dim=-2)
    return udf.Closest(torch.from_numpy(found["depth"]), torch.nn.functional.normalize(mean, dim=-1))


def candidate_recipe(config: figure_fields.FiguresConfig) -> closest_candidates.CandidateConfig:
    """g_v in seconds, or as [DDF22] app. D trains it."""
    if config.paper_candidates:
        return closest_candidates.CandidateConfig(loop_config.LoopConfig(schedule="constant", threads=1))
    loop = loop_config.LoopConfig(1e-3, "cosine", 0, 1.0, 1)
    return closest_candidates.CandidateConfig(loop, config.candidate_steps, 256, omega_first=3.0)


def _exactly(
    nearest: Nearest, positions: Float[np.ndarray, "n 3"]
) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n 3"]]:
    """True distances and v*."""
    ways = nearest(positions) - positions
    distances = np.linalg.norm(ways, axis=1)
    return distances, ways / np.maximum(distances, 1e-12)[:, None]


def _errors(
    found: Found, positions: Float[np.ndarray, "n 3"], nearest: Nearest
) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
    """Of distances, and degrees between v* and the true one; NaN where nothing is found."""
    distances, ways = _exactly(nearest, positions)
    angles = np.degrees(np.arccos(np.clip((found.directions * ways).sum(axis=1), -1, 1)))
    return np.abs(found.distances - distances), np.where(np.isfinite(found.distances), angles, np.nan)


def slices(
    level: float, field: ShapeField, nearest: Nearest, cloud: checked_cloud.CheckedCloud, size: int
) -> list[picture_strips.Picture]:
    """UDF and v* with the exact ones, in a plane z = const, at a share of the box."""
    positions = beside.plane(field, level, size)
    (distances, ways), (true, true_ways) = cloud.distances(positions), _exactly(nearest, positions)
    pictures = field_pictures.depth_pictures(distances.reshape(size, size), true.reshape(size, size))
    seen = np.ones((size, size))
    coloured = [field_pictures.normals_picture(each.reshape(size, size, 3), seen) for each in (ways, true_ways)]
    return [*pictures, *coloured]
