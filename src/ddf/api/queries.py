"""What fields and scenes have in common: queries, pictures and distances, in the frame of the mesh or of the scene."""

from collections.abc import Collection
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from jaxtyping import Float

from ddf.core import checks
from ddf.fields import checked_cloud, framed_field
from ddf.geometry import rays, transforms

FARTHEST = 1e100


class Queried:
    """A field or a scene that can be asked along rays, from cameras and for distances. up: the axis that points up."""

    up: Literal["y", "z"] = "y"

    def __init__(self, framed: framed_field.FramedField) -> None:
        self.framed = framed

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names that `query` and `render` know."""
        return self.framed.outputs

    @property
    def box(self) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """Lower and upper corner of the box that holds the surface, in the frame of the mesh."""
        return self.corners.min(axis=0), self.corners.max(axis=0)

    @property
    def corners(self) -> Float[np.ndarray, "8 3"]:
        """The corners of the field's box, in the frame of the mesh, where it may stand askew."""
        corners = transforms.box_corners(self.framed.lower, self.framed.upper)
        return self.framed.field_from_mesh.inverse().apply(corners)

    def query(
        self,
        positions: npt.ArrayLike,
        directions: npt.ArrayLike,
        outputs: Collection[str] = ("depth", "visibility"),
    ) -> dict[str, Float[np.ndarray, "n ..."]]:
        """What is seen from positions along directions.

        Args:
          positions: (n, 3), anywhere, in the frame and the unit of the mesh.
          directions: (n, 3), of length 1.
          outputs: some of `outputs`.
        Returns:
          float64 arrays by name. `visibility` (n): in [0, 1], 0 where the box is missed. `depth` (n): along the ray, in
          the unit of the mesh, `inf` where nothing is seen (visibility below 1/2). `normals` (n, 3): unit, facing back,
          0 where nothing is seen. `mean_curvature` (n): κ1 + κ2, negative where the surface is convex, in 1/unit.
          `gaussian_curvature` (n): κ1 κ2, in 1/unit².
        Raises:
          ValueError: a shape that is not (n, 3), a value that is not finite, a direction that is not of unit length, an
            output that does not exist.

        Example:
          >>> import ddf
          >>> rabbit = ddf.load("rabbit")
          >>> seen = rabbit.query([[0.0, 0.45, 5.0]], [[0.0, 0.0, -1.0]])
          >>> sorted(seen), seen["depth"].shape, bool(seen["visibility"][0] > 0.5)
          (['depth', 'visibility'], (1,), True)
        """
        return framed_field.query(self.framed, require_oriented_points(positions, directions), outputs)[0]

    def render(
        self,
        azimuth_deg: int | float = 35.0,
        elevation_deg: int | float = 25.0,
        radius: int | float | None = None,
        size: int = 256,
        outputs: Collection[str] = ("depth", "visibility"),
        up: str | None = None,
    ) -> dict[str, Float[np.ndarray, "size size ..."]]:
        """Pictures from a camera that looks at the centre of the box.

        Args:
          azimuth_deg, elevation_deg: where the camera stands.
          radius: its distance from the centre, 0.57 is one diagonal of the box; None frames the box.
          size: pixels a side.
          outputs: some of `outputs`, as `query` gives them; depth is along the ray, from the camera.
          up: the axis of the mesh that points up, y or z; None: what `ddf fit --up` or the scene file says, else y.
        Returns:
          float64 arrays by name, (size, size) or (size, size, 3), the first row on top.
        Raises:
          ValueError: a number that is not finite, a negative radius, a size below 1, an output that does not exist.

        Example:
          >>> import ddf
          >>> pictures = ddf.load("rabbit").render(35, 25, size=32, outputs=("depth", "normals"))
          >>> pictures["depth"].shape, pictures["normals"].shape
          ((32, 32), (32, 32, 3))
        """
        checks.require_whole("size", size, 1)
        up = up or self.up
        if radius is None:
            radius = framed_field.framing_radius(self.framed, float(azimuth_deg), float(elevation_deg), up)
        camera = (float(azimuth_deg), float(elevation_deg), float(radius))
        return framed_field.render(self.framed, camera, size, outputs, up)[0]

    def udf(self, positions: npt.ArrayLike) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n 3"]]:
        """Unsigned distances to the surface, and the directions of its closest point.

        The distance is that to the nearest of points that are drawn at the first call: of patches, anywhere on them;
        else hits. Each hit was asked for again from four other starts. Those stay on which the answers agree better
        than on their neighbours, and each is moved into the plane of the hits around it.

        Args:
          positions: (n, 3), anywhere, in the frame and the unit of the mesh.
        Returns:
          Distances (n) in the unit of the mesh, and unit directions (n, 3), 0 where the distance is 0.
        Raises:
          ValueError: a shape that is not (n, 3), a value that is not finite, or a field in which nothing is seen.

        Example:
          >>> import ddf
          >>> distances, directions = ddf.load("rabbit").udf([[0.0, 2.0, 0.0]])
          >>> distances.shape, directions.shape, bool(distances[0] > 0.5)
          ((1,), (1, 3), True)
        """
        asked = require_points("positions", positions)  # before a cloud is drawn
        return self.cloud.distances(asked)

    @cached_property
    def cloud(self) -> checked_cloud.CheckedCloud:
        """The points that `udf` measures to, drawn at the first use: a field's own, or hits."""
        own = getattr(self.framed, "cloud", None)
        return checked_cloud.draw(self.framed) if own is None else own()


def require_points(name: str, values: Any) -> Float[np.ndarray, "n 3"]:
    """Numbers of shape (n, 3), finite, as float64."""
    array = np.asarray(values)
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "fiu":
        raise checks.InputError(f"{name} must be numbers of shape (n, 3); got {array.dtype} of shape {array.shape}")
    checks.require_finite(name, array)
    return array.astype(np.float64)


def require_oriented_points(positions: Any, directions: Any) -> rays.OrientedPoints[np.ndarray]:
    """Positions and directions of one shape (n, 3), float64; directions within 1e-4 of unit length become of it."""
    starts, along = require_points("positions", positions), require_points("directions", directions)
    if len(starts) != len(along):
        raise checks.InputError(f"positions and directions must be as many; got {len(starts)} and {len(along)}")
    require_near(starts)
    return rays.unit_points(starts, along)


def require_near(positions: Float[np.ndarray, "n 3"]) -> None:
    """InputError of positions whose squares no float64 holds."""
    if np.abs(positions).max(initial=0.0) > FARTHEST:
        raise checks.InputError(f"positions must be within {FARTHEST:g}")


def require_poses(name: str, matrices: Any) -> list[transforms.Similarity]:
    """One 4x4 matrix or several, (k, 4, 4), of that name, that neither shear nor mirror."""
    array = np.asarray(matrices)
    if array.ndim == 3 and not len(array):
        raise checks.InputError(f"{name} must be a 4x4 matrix or several; got none")
    return [transforms.Similarity.of_matrix(name, each) for each in (array if array.ndim == 3 else [array])]
