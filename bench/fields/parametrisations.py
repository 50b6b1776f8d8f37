"""Depth images by what a network reads of a ray: our (p, v) and peers' lines; against sphere tracing.

All networks have the hidden layers of `ddf fit`'s. Each is trained here for as many seconds of one core
(`--seconds`) on rays of outside cameras, whose truth was cast before. One row of ours learns from rays that begin
inside the box besides. Rows hold the time of one depth image, of its one thread, however busy the machine is; and
errors over held-out cameras outside, in field units. "inside": rays
from free points inside the box, between surfaces, where a field of lines knows one surface a line; `inside_wrong` is
the share of them whose visibility is wrong, or whose depth is off by more than `CLOSE`. Signed distances are traced.
"""

import dataclasses
import functools
import time
from collections.abc import Callable, Mapping

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from bench.lib import measuring
from bench.rivals import distances, ray_fields
from ddf.core import seeding
from ddf.data import mesh_config, mesh_preparation
from ddf.data.synthetic import showcase
from ddf.fields import derivatives, siren
from ddf.fit import fit_settings
from ddf.geometry import cameras, mesh_io, raycast, rays, transforms
from ddf_lab.evaluation import shape_fits

SECONDS, REPEATS, SIZE = 60.0, 9, 256
FACES, MARGIN, UNIT = 4_000, 0.02, 0.98  # triangles of a mesh; its box beyond it; half its longest side
TRAIN_CAMERAS, RAYS_EACH, INSIDE_RAYS = 2_000, 250, 200_000
TRAIN_RADII = (0.6, 1.1)  # of training cameras, benchmark units
BATCH, DISTANCES = 2048, 100_000  # rays of a step; signed distances that are drawn
HELD_OUT = ((35.0, 25.0), (215.0, 15.0), (125.0, -25.0), (300.0, 60.0))  # azimuth and elevation, degrees
HELD_OUT_RADIUS = 0.8
FREE_POINTS, LOOKS, CLEAR = 64, 512, 0.1  # inside: points, rays of each, and how far from the surface
CLOSE = 0.02  # field units, 1 % of the shape
CHUNK = 4096
OURS, BOTH, FOOT = "DDF: entry of the box", "DDF, inside rays too", "foot of the perpendicular"
BUDGET = distances.Tracing(12, 1e-2, 1e-2)  # of six budgets the one with the fewest wrong rays
TRACED = f"sphere tracing, {BUDGET.max_steps} steps, f < {BUDGET.threshold:g}"
DISTANCE_OMEGA, DISTANCE_RATE = 10.0, 2e-3  # omega_first and learning rate of the signed-distance network


def shapes() -> dict[str, mesh_io.Mesh]:
    """A chair, and a box with a window and a cube in it; both closed, in the frame of the fields."""
    wrapped, placed = mesh_config.MeshesConfig(faces=FACES, wrap="always"), {}
    for name, raw in {"chair": shape_fits.source_mesh(None, 0)[0], "nested": showcase.nested()}.items():
        mesh = mesh_preparation.prepare(raw, wrapped, seeding.generator(0, "bench")).mesh
        vertices = UNIT * transforms.field_from_mesh(mesh.vertices).apply(mesh.vertices)
        placed[name] = mesh_io.Mesh(vertices, mesh.faces)
    return placed


@dataclasses.dataclass(frozen=True)
class Place:
    """A mesh, its scene and its box, float64; the box's centre is the origin."""

    mesh: mesh_io.Mesh
    scene: raycast.Scene
    upper: Float[np.ndarray, "3"]

    @classmethod
    def of(cls, mesh: mesh_io.Mesh) -> "Place":
        """Of a mesh that is centred."""
        return cls(mesh, raycast.Scene(mesh), mesh.box()[1] + MARGIN)

    @property
    def unit(self) -> float:
        """Field units per benchmark unit."""
        return 2 * float(np.linalg.norm(self.upper)) / transforms.BENCHMARK_FROM_V1

    @property
    def radius(self) -> float:
        """Of the sphere through the box's corners."""
        return float(np.linalg.norm(self.upper))

    def corners(self) -> tuple[Float[Tensor, "3"], Float[Tensor, "3"]]:
        """Of the box, float32."""
        upper = torch.from_numpy(self.upper).float()
        return -upper, upper

    def see(self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]) -> ray_fields.SeenRays:
        """What rays see."""
        p, v = torch.from_numpy(positions), torch.from_numpy(directions)
        return ray_fields.SeenRays(p.float(), v.float(), raycast.cast(self.scene, rays.OrientedPoints(p, v)))


def outside_rays(place: Place, random: np.random.Generator) -> ray_fields.SeenRays:
    """From cameras all around, each towards points uniform in the box; camera after camera."""
    centres = _unit(random.standard_normal((TRAIN_CAMERAS, 3))) * random.uniform(*TRAIN_RADII, (TRAIN_CAMERAS, 1))
    starts = np.repeat(place.unit * centres, RAYS_EACH, axis=0)
    return place.see(starts, _unit(random.uniform(-place.upper, place.upper, starts.shape) - starts))


def inside_rays(place: Place, random: np.random.Generator) -> ray_fields.SeenRays:
    """From points uniform in the box, all directions."""
    starts = random.uniform(-place.upper, place.upper, (INSIDE_RAYS, 3))
    return place.see(starts, _unit(random.standard_normal(starts.shape)))


def between(place: Place, random: np.random.Generator) -> ray_fields.SeenRays:
    """All directions from free points in the box, `CLEAR` of the surface or more."""
    drawn = random.uniform(-place.upper, place.upper, (100 * FREE_POINTS, 3))
    free = drawn[place.scene.outside(drawn)]
    free = free[place.scene.distance(free) > CLEAR][:FREE_POINTS]
    starts = np.repeat(free, LOOKS, axis=0)
    return place.see(starts, _unit(random.standard_normal(starts.shape)))


def held_out(place: Place) -> ray_fields.SeenRays:
    """All pixels of the held-out cameras, one image after the other."""
    pixels = cameras.pixel_directions(SIZE, np.array(1.0)).reshape(-1, 3)
    starts, directions = [], []
    for azimuth, elevation in HELD_OUT:
        camera = cameras.degrees_to_radians(np.array([azimuth, elevation, HELD_OUT_RADIUS]))
        centre, world = cameras.pixel_rays(camera[0:1], camera[1:2], camera[2:3], pixels)
        starts.append(np.repeat(place.unit * centre, len(pixels), axis=0))
        directions.append(world.reshape(-1, 3))
    return place.see(np.concatenate(starts), np.concatenate(directions))


def _unit(vectors: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


Answer = Callable[[Tensor, Tensor], Tensor]  # of rays that meet the box, positions and directions


@dataclasses.dataclass(frozen=True)
class Candidate:
    """depth: `inf` where nothing is seen. normals: of rays that see something, at this depth. steps: of training."""

    depth: Answer
    normals: Callable[[Tensor, Tensor, Tensor], Tensor]
    steps: int


def image(candidate: Candidate, place: Place, p: Float[Tensor, "n 3"], v: Float[Tensor, "n 3"]) -> Float[Tensor, "n"]:
    """Depth of all pixels of one camera, of which those whose rays miss the box cost a test."""
    first, last = rays.box_span(p, v, *place.corners())
    depth = torch.full_like(first, torch.inf)
    for rows in torch.nonzero(first <= last).squeeze(-1).split(CHUNK):
        depth[rows] = candidate.depth(p[rows], v[rows])
    return depth


def outside_errors(candidate: Candidate, place: Place, seen: ray_fields.SeenRays) -> dict[str, float]:
    """Of the held-out cameras."""
    views = list(zip(seen.positions.split(SIZE**2), seen.directions.split(SIZE**2), strict=True))
    depth, normals = torch.cat([image(candidate, place, p, v) for p, v in views]), torch.zeros_like(seen.positions)
    hit = torch.isfinite(depth)
    normals[hit] = candidate.normals(seen.positions[hit], seen.directions[hit], depth[hit])
    both = hit & seen.truth.visible
    off = (depth[both].double() - seen.truth.depth[both]).abs()
    cosine = (normals[both].double() * seen.truth.normals[both]).sum(-1).clamp(-1, 1)
    return {
        "depth_median": float(off.median()),
        "depth_mean": float(off.mean()),
        "wrong_visibility": float((hit != seen.truth.visible).double().mean()),
        "silhouette_iou": int(both.sum()) / int((hit | seen.truth.visible).sum()),
        "normal_angle_deg_median": float(torch.rad2deg(torch.acos(cosine)).median()),
    }


def inside_errors(candidate: Candidate, inner: ray_fields.SeenRays) -> dict[str, float]:
    """Median depth error where both see something, and the share of rays told wrongly: seen or not, or the depth."""
    depth, truth = candidate.depth(inner.positions, inner.directions), inner.truth
    both = torch.isfinite(depth) & truth.visible
    off = (depth - truth.depth).abs()
    right = torch.where(truth.visible, both & (off < CLOSE), ~torch.isfinite(depth))
    return {"inside_depth_median": float(off[both].median()), "inside_wrong": float(1 - right.double().mean())}


def section() -> fit_settings.FitConfig:
    """Of all networks, one thread."""
    found = fit_settings.FitConfig()
    return dataclasses.replace(found, loop=dataclasses.replace(found.loop, threads=1))


def ray_candidates(
    place: Place, outside: ray_fields.SeenRays, inside: ray_fields.SeenRays, seconds: float
) -> dict[str, Candidate]:
    """Fields of rays: equal networks, equal steps, which take ours so many seconds."""
    settings, (lower, upper) = section(), place.corners()
    own = functools.partial(ray_fields.box_entry, lower=lower, upper=upper)

    def train(reads: ray_fields.RayInput, *lessons: ray_fields.SeenRays, steps: int) -> Candidate:
        field = ray_fields.fit(reads, lessons, settings, BATCH, steps)
        return Candidate(field.depth, lambda p, v, _: field.normals(p, v), steps)

    steps = measuring.steps_within(lambda count: train(own, outside, steps=count), seconds)
    found = {OURS: train(own, outside, steps=steps), BOTH: train(own, outside, inside, steps=steps)}
    reads = functools.partial(ray_fields.foot, radius=place.radius)
    return found | {FOOT: train(reads, outside, steps=steps)}


def traced_candidate(place: Place, seconds: float) -> Candidate:
    """A network of signed distances, marched on; normals are ∇f/‖∇f‖ at the hits, facing back."""
    settings = section()
    loop = dataclasses.replace(settings.loop, learning_rate=DISTANCE_RATE)
    layout = siren.SineLayout(settings.field.hidden, DISTANCE_OMEGA)
    train = functools.partial(distances.fit_distance, place.mesh, layout, loop, DISTANCES)
    steps = measuring.steps_within(train, seconds)
    network = train(steps)

    def depth(p: Tensor, v: Tensor) -> Tensor:
        return distances.trace(lambda q: network(q).squeeze(-1), p, v, *place.corners(), BUDGET)[0]

    def normals(p: Tensor, v: Tensor, depth: Tensor) -> Tensor:
        found = derivatives.trace(network, rays.surface_points(p, v, depth))
        return derivatives.normals(derivatives.adjoint(network, found.slopes, torch.ones_like(found.outputs)), v)

    return Candidate(depth, normals, steps)


LINES = (OURS, BOTH, FOOT, TRACED)  # of the page


def main(*, seconds: float = SECONDS) -> measuring.Rows:
    """Every network, for both shapes.

    Args:
      seconds: of one core, for each training.
    """
    for name, mesh in shapes().items():
        place = Place.of(mesh)
        outside, inside, inner = (
            draw(place, seeding.generator(0, "ray_parametrisations", name, draw.__name__))
            for draw in (outside_rays, inside_rays, between)
        )
        found = ray_candidates(place, outside, inside, seconds) | {TRACED: traced_candidate(place, seconds)}
        rows = rows_of(name, place, found, inner, seconds)
        yield from ({**row, "times_ddf": row["median_s"] / rows[0]["median_s"]} for row in rows)


@torch.no_grad()
def rows_of(
    name: str, place: Place, found: Mapping[str, Candidate], inner: ray_fields.SeenRays, seconds: float
) -> list[measuring.Row]:
    """Of one shape: the time is that of the first held-out image."""
    torch.use_deterministic_algorithms(False)  # training switches it on
    seen = held_out(place)
    p, v = seen.positions[: SIZE**2], seen.directions[: SIZE**2]
    asked = {what: functools.partial(image, one, place, p, v) for what, one in found.items()}
    rows = []
    for what, taken in measuring.interleaved(asked, REPEATS, clock=time.process_time).items():
        error = outside_errors(found[what], place, seen) | inside_errors(found[what], inner)
        size = {"shape": name, "pixels_a_side": SIZE, "train_seconds": seconds}
        rows.append(measuring.row(what, size, taken, error) | {"steps": found[what].steps})
    return rows
