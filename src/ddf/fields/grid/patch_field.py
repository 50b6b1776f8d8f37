"""A field of patches: what it is asked, its file, and even points on it. It is a `framed_field.FramedField`.

Of the paper's mixture it is the case in which component k is the k-th patch that the ray could meet, and the weights
are 0 and 1: visibility is certain. Inside a cell Properties I to III and V hold by construction, since depth is the
root of f(p + d v) = 0.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from ddf.core import checks, storage
from ddf.fields import checked_cloud, field_file, framed_field
from ddf.fields.grid import kernels, octree
from ddf.geometry import mesh_io, transforms

OUTPUTS = ("visibility", "depth", "normals", "mean_curvature", "gaussian_curvature")
MARGIN = 0.02  # between the shape and the cube [-1, 1]³: rays from outside begin on no face
BOX_MARGIN = 0.01  # between the shape and its box
FAR, BEFORE = 1e3, 4.0  # starts beyond FAR are moved to BEFORE the point that is nearest to 0: t + STEP is t at 1e8
CLOUD = 40_000  # points that distances are measured to
_COLUMNS = {"depth": 0, "normals": slice(1, 4), "mean_curvature": 4, "gaussian_curvature": 5}


@dataclass(frozen=True)
class PatchField:
    """Patches, their box (field frame), the map to that frame, the tolerance they were fitted to, and the file."""

    tree: octree.Octree
    lower: Float[np.ndarray, "3"]
    upper: Float[np.ndarray, "3"]
    field_from_mesh: transforms.Similarity
    tolerance: float
    arrays: Mapping[str, np.ndarray]
    record: Mapping[str, Any]

    enters_its_box = True  # as `framed_field` asks: rays from outside need no slab test

    @property
    def parameters(self) -> int:
        """Numbers that make the field."""
        return sum(values.size for values in self.arrays.values())

    @property
    def outputs(self) -> tuple[str, ...]:
        """All but those of the sine field's two components."""
        return OUTPUTS

    def evaluate(
        self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"], outputs: Collection[str]
    ) -> dict[str, Float[np.ndarray, "n ..."]]:
        """Named outputs, field frame, float64; 0 on a miss, as is the visibility, which is else 1."""
        met = self.met(positions, directions)
        seen = np.isfinite(met[:, 0])
        met[~seen, 0] = 0.0
        found = {name: met[:, column] for name, column in _COLUMNS.items() if name in outputs}
        return found | ({"visibility": seen.astype(np.float64)} if "visibility" in outputs else {})

    def seen(self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
        """Whether the rays that the field was fitted to saw all the way up to the answer, in the mesh's frame;
        InputError where it was fitted to a mesh.
        """
        if octree.UNSEEN not in self.arrays:
            raise checks.InputError("the field was not fitted to rays, so all of it is known")
        to_field = self.field_from_mesh
        return self.met(to_field.apply(positions), to_field.apply_directions(directions))[:, 6] > 0

    def met(self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]) -> np.ndarray:
        """As `kernels.trace`."""
        tree, (starts, along) = self.tree, (np.require(v, np.float64, ["C", "W"]) for v in (positions, directions))
        box, way = np.stack([self.lower, self.upper]), np.zeros(())
        if max(starts.max(initial=0.0), -starts.min(initial=0.0)) > FAR:  # asked of all, which costs next to nothing
            way = np.maximum(-(starts * along).sum(axis=1) - BEFORE, 0.0)
            way[np.abs(starts).max(axis=1) <= FAR] = 0.0
            starts = starts + way[:, None] * along
        met = kernels.trace(starts, along, box, tree.base, tree.children, tree.patches, tree.codes, self.tolerance)
        met[:, 0] += way
        return met

    def points(self, count: int, seed: int = 0) -> Float[np.ndarray, "count 3"]:
        """Points on the patches, mesh frame, evenly spread by area; InputError where they are fewer than 1."""
        return self.field_from_mesh.inverse().apply(self._spread(count, seed)[0])

    def save(self, folder: Path) -> Path:
        """The field's file, as `ddf fit` writes it."""
        return field_file.write(folder, self.arrays, self.record)

    def cloud(self) -> checked_cloud.CheckedCloud:
        """Points with their planes, for distances, mesh frame."""
        points, normals, area = self._spread(CLOUD, 0)
        order = np.random.default_rng(0).permutation(CLOUD)  # a part of it, as surfaces take, is of all the shape
        points, normals = points[order], normals[order]
        back = self.field_from_mesh.inverse()
        radii = np.full(CLOUD, back.scale * np.sqrt(2 * area / CLOUD / np.pi))  # discs overlap, as `flat_discs`
        return checked_cloud.CheckedCloud(
            checked_cloud.Discs(back.apply(points), back.apply_directions(normals), radii)
        )

    def _spread(self, count: int, seed: int) -> tuple[np.ndarray, np.ndarray, float]:
        """Points at equal steps of area along the order of the cells, normals of their patches, and the whole area."""
        if count < 1:
            raise checks.InputError(f"the number of points must be >= 1; got {count}")
        samples, patch, area = self._samples
        if len(area) == 0:
            raise checks.InputError("no patch of the field lies in its cell")
        ends = np.cumsum(area)
        steps = (np.arange(count) + np.random.default_rng(seed).uniform(size=count)) / count * ends[-1]
        chosen = np.minimum(np.searchsorted(ends, steps), len(ends) - 1)
        return samples[chosen], self.tree.patches[patch[chosen], :3].astype(np.float64), float(ends[-1])

    @cached_property
    def _samples(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points of a grid on every patch, the patch of each, and its share of the area."""
        tree, count = self.tree, len(self.tree.codes)
        samples = kernels.sample_patches(tree.patches.astype(np.float64), tree.codes, tree.sides)
        patch, here = np.nonzero(np.isfinite(samples[..., 0]))
        facing = np.abs(tree.patches[:, :3]).max(axis=1)
        area = (tree.sides / kernels.GRID) ** 2 / facing
        return samples[patch, here] + tree.centres[patch], patch, np.broadcast_to(area, (count,))[patch]


def fitted(
    mesh: mesh_io.Mesh,
    own_from_mesh: transforms.Similarity,
    config: octree.PatchConfig,
    evidence: octree.Evidence | None = None,
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """The arrays of a mesh's patches, and what the record of the file must hold besides what every artefact carries.

    Args:
      mesh: in [-1, 1]³, its longest side 2. own_from_mesh: the map that brought it there.
      evidence: of what was seen, in the frame from which that map leads.
    """
    mesh = mesh_io.Mesh((1 - MARGIN) * mesh.vertices, mesh.faces)
    lower, upper = mesh.box()
    field_from_mesh = transforms.Similarity(1 - MARGIN).compose(own_from_mesh)
    back = field_from_mesh.inverse()
    asked = None if evidence is None else lambda lows, side: evidence(back.apply(lows), side * back.scale)
    return octree.build(mesh, config, asked), {
        "kind": field_file.PATCHES,
        "tolerance": config.tolerance,
        "box": {"lower": (lower - BOX_MARGIN).tolist(), "upper": (upper + BOX_MARGIN).tolist()},
        "field_from_mesh": field_from_mesh.to_dict(),
    }


def of(arrays: Mapping[str, np.ndarray], record: Mapping[str, Any]) -> PatchField:
    """The field of the content of a file; KeyError, TypeError or ValueError where it does not fit together."""
    lower, upper = framed_field.corners(record["box"]["lower"], record["box"]["upper"])
    place, tolerance = transforms.Similarity.from_dict(record["field_from_mesh"]), float(record["tolerance"])
    if np.abs([lower, upper]).max() > 1 or not 0 < tolerance <= 1:
        raise checks.InputError(
            f"its box must lie in [-1, 1]³, its tolerance in (0, 1]; got {lower}, {upper}, {tolerance}"
        )
    return PatchField(octree.unpack(arrays), lower, upper, place, tolerance, arrays, record)


def load(file: Path) -> PatchField:
    """The field of a file."""
    arrays, record = storage.load_tensors(file)
    if record.get("kind") != field_file.PATCHES:
        raise checks.InputError(f"{file}: holds no field of patches")
    with framed_field.record_of(file):
        return of(arrays, record)
