"""Fields against what renders a mesh without one, as its triangles grow from 1,000 to 1,000,000: error and time.

`rock` is a sphere whose radius waves at every wavelength that its triangles carry, so a finer one has finer detail;
`hoops` are rings of 1/100 the shape's size, `cut` the rock of 10,000, each triangle cut into 64 that add nothing.
`patches` is what `ddf fit` makes, `sine` a network of as many bytes after some steps; `distances` is sphere tracing,
compiled, through a grid of signed distances; `mesh` is Open3D's cast in float32 (Embree) and nothing else. Times are
CPU time of one core, for the rays of an image of 256 x 256, which are given to all but the network; errors as in fits.
"""

import dataclasses
import functools
import time

import numpy as np
import trimesh

from bench.data import ray_casting
from bench.fields import fits
from bench.lib import measuring
from bench.rivals import distances
from ddf.fields.grid import octree
from ddf.geometry import mesh_io, raycast, rays

GROWING, STEPS, SIDES = fits.GROWING, 500, (128, 256)
PER_WAVE, SLOPE, WAVES = 4, 0.05, 24  # edges of a wave; its height over its length; waves of a length
HOOPS, WIDTH = 10, 0.01


def rock(count: int) -> mesh_io.Mesh:
    """About so many triangles; lengths of waves are halved until four edges make one."""
    sphere, random = ray_casting.sphere(count), np.random.default_rng(3)
    edge, length, radius = 2 * np.pi / np.sqrt(count), 2.0, np.ones(len(sphere.vertices))
    while length >= PER_WAVE * edge:
        ways = random.standard_normal((WAVES, 3))
        ways *= 2 * np.pi / length / np.linalg.norm(ways, axis=1, keepdims=True)
        phases = random.uniform(0, 2 * np.pi, WAVES)
        for way, phase in zip(ways, phases, strict=True):
            radius += SLOPE * length / np.sqrt(WAVES) * np.sin(sphere.vertices @ way + phase)
        length /= 2
    return mesh_io.Mesh(sphere.vertices * radius[:, None], sphere.faces)


def hoops(count: int) -> mesh_io.Mesh:
    """Thin rings, one in the other, none touching, turned at random."""
    around = round(np.sqrt(count / HOOPS / 2 * 10))
    vertices, faces = [], []
    for turn, radius in enumerate(np.linspace(0.35, 0.99, HOOPS)):
        part = trimesh.creation.torus(radius, WIDTH, major_sections=around, minor_sections=around // 10)
        part.apply_transform(trimesh.transformations.random_rotation_matrix(np.random.default_rng(turn).random(3)))
        faces.append(np.array(part.faces) + sum(map(len, vertices)))
        vertices.append(np.array(part.vertices))
    return mesh_io.Mesh(np.concatenate(vertices), np.concatenate(faces))


def cut(mesh: mesh_io.Mesh) -> mesh_io.Mesh:
    """The same surface of 64 times as many triangles."""
    found = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    for _ in range(3):
        found = found.subdivide()
    return mesh_io.Mesh(np.array(found.vertices), np.array(found.faces))


def meshes() -> dict[str, mesh_io.Mesh]:
    """By name."""
    rocks = {f"rock {count:,}": rock(count) for count in GROWING}
    return {**rocks, "hoops": hoops(100_000), "cut rock 10,000": cut(rocks["rock 10,000"])}


def grid(scene: raycast.Scene, side: int, points: rays.OrientedPoints) -> fits.Way:
    """Sphere tracing through so many voxels along the longest side. points: rays of the image."""
    started = time.process_time()
    made = distances.on_grid(scene, side)
    took = time.process_time() - started
    return fits.Way(f"distances, {side}", made.cast, lambda: made.cast(points), made.samples.nbytes, took)


LINES = ("patches, 0.0003", "sine, 500 steps", "distances, 128", "distances, 256", "mesh")  # of the page


def main(*, steps: int = STEPS) -> measuring.Rows:
    """Every mesh by every way.

    Args:
      steps: of the network; up to 100,000 triangles.
    """
    fits.compile_patches()
    for name, mesh in meshes().items():
        scene, (patches, field) = raycast.Scene(mesh), fits.patches(mesh, octree.PatchConfig().tolerance)
        points, to_field = fits.picture(field, *fits.CAMERA), field.field_from_mesh
        starts, ways = to_field.apply(points.positions), to_field.apply_directions(points.directions)
        image = functools.partial(field.evaluate, starts, ways, ("visibility", "depth"))
        made = [fits.sine(mesh, steps, patches.size)] if len(mesh.faces) <= GROWING[2] else []
        made += [grid(scene, side, points) for side in SIDES]
        made = [dataclasses.replace(patches, image=image), *made, fits.cast(mesh, points)]
        yield from fits.rows_of(name, mesh, field, made)
