"""A true point cloud of a shape as the stage `samples` stores it; how it is drawn: `true_clouds`."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from ddf.geometry import transforms


@dataclass(frozen=True)
class Cloud:
    """Points on a surface, in the mesh's frame, and whether each is hidden from outside."""

    points: Float[np.ndarray, "n 3"]
    hidden: Bool[np.ndarray, "n"]

    @classmethod
    def stored(cls, shard: Mapping[str, np.ndarray], row: int) -> "Cloud":
        """That of one shape of a shard that the stage `samples` wrote (`sample_shards`)."""
        start, end = shard["offsets"][row : row + 2]
        return cls(shard["points"][start:end], shard["hidden"][start:end].astype(bool))

    def benchmark_points(self, visible_only: bool = False) -> Float[np.ndarray, "m 3"]:
        """Points of a mesh in the v1 frame in the benchmark's, all of them or those that are not hidden."""
        points = self.points[~self.hidden] if visible_only else self.points
        return transforms.BENCHMARK_FROM_V1 * points.astype(np.float64)
