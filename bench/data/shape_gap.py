"""How far public training shapes are from procedural ones: Chamfer distance from each to its nearest of 300, D_C as in
the tables (squared, both ways, benchmark units, x 1000). It needs the packages of `ddf shapes get`.
"""

import time
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy import spatial

from bench.lib import measuring
from ddf.data.public import manifest, packages, shapes
from ddf.data.samples.surface import Surface
from ddf.data.synthetic import assemble, write
from ddf.geometry import transforms
from ddf.geometry.mesh_io import Mesh

ON_DEMAND = "python -m bench shape_gap"
CATEGORIES = ("chair", "plane", "car")
SEED, COUNT, POINTS, ASKED = 4711, 300, 4000, 600  # of the other cloud's nearest points; the first ASKED look for them


def cloud(shape: assemble.Shape, seed: int) -> Float[np.ndarray, "n 3"]:
    """Points of a surface in benchmark units."""
    drawn, _ = Surface.of(Mesh(shape.vertices, shape.triangles)).draw(POINTS, np.random.default_rng(seed))
    return drawn * transforms.BENCHMARK_FROM_V1


def nearest(wanted: Sequence[np.ndarray], known: Sequence[np.ndarray]) -> list[float]:
    """Of each cloud the least D_C x 1000 to the known ones."""
    trees = [spatial.KDTree(points) for points in known]
    found = []
    for points in wanted:
        own = spatial.KDTree(points)
        sums = [
            (tree.query(points[:ASKED])[0] ** 2).mean() + (own.query(other[:ASKED])[0] ** 2).mean()
            for other, tree in zip(known, trees, strict=True)
        ]
        found.append(1000 * float(min(sums)))
    return found


def main() -> None:
    """Median, 90th percentile and the worst shapes of each category."""
    rows = []
    for category in CATEGORIES:
        began = time.perf_counter()
        chosen = [row for row in manifest.of([category]) if row.split == "train"]
        public = [cloud(_shape(row), 0) for row in chosen]
        made = [cloud(write.make_shape(SEED, category, index), 1) for index in range(COUNT)]
        found = sorted(zip(nearest(public, made), (row.id for row in chosen), strict=True), reverse=True)
        distances = [distance for distance, _ in found]
        figures = {"median": float(np.median(distances)), "p90": float(np.percentile(distances, 90))}
        size = {"public": len(chosen), "procedural": COUNT}
        rows.append(
            measuring.row(category, size, [time.perf_counter() - began], figures | {n: d for d, n in found[:5]})
        )
    measuring.write("shape_gap", 1, rows)


def _shape(row: manifest.Row) -> assemble.Shape:
    kept = packages.require(packages.PACKAGES[row.package], manifest.wanted(row.package))
    with packages.reading(kept) as archive:
        return shapes.shape(shapes.load(archive, row))
