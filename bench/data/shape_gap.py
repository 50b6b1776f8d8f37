"""How far public training shapes are from procedural ones, with `--wide` from the wide designs: Chamfer distance from
each to its nearest of 300, D_C as in the tables (squared, both ways, benchmark units, x 1000). `held`: of every third
shape by id, on which no design was tuned. It needs the packages of `ddf shapes get`.
"""

import argparse
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
SEED, COUNT, POINTS, ASKED = 7127, 300, 4000, 600  # of the other cloud's nearest points; the first ASKED look for them


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


def main(arguments: Sequence[str] = ()) -> None:
    """Median, 90th percentile and the worst shapes of each category."""
    parser = argparse.ArgumentParser("python -m bench shape_gap", description=__doc__)
    parser.add_argument("--wide", action="store_true", help="measure the wide designs")
    wide = parser.parse_args(arguments).wide
    rows = []
    for category in CATEGORIES:
        began = time.perf_counter()
        chosen = sorted((row for row in manifest.of([category]) if row.split == "train"), key=lambda row: row.id)
        public = [cloud(_shape(row), 0) for row in chosen]
        made = [cloud(write.make_shape(SEED, category, index, wide), 1) for index in range(COUNT)]
        distances = nearest(public, made)
        found = sorted(zip(distances, (row.id for row in chosen), strict=True), reverse=True)
        figures = {"median": float(np.median(distances)), "p90": float(np.percentile(distances, 90))}
        figures["held"] = float(np.median(distances[::3]))
        size = {"public": len(chosen), "procedural": COUNT}
        rows.append(
            measuring.row(category, size, [time.perf_counter() - began], figures | {n: d for d, n in found[:5]})
        )
    measuring.write("shape_gap_wide" if wide else "shape_gap", 1, rows)


def _shape(row: manifest.Row) -> assemble.Shape:
    kept = packages.require(packages.PACKAGES[row.package], manifest.wanted(row.package))
    with packages.reading(kept) as archive:
        return shapes.shape(shapes.load(archive, row))
