"""A way of drawing clouds for a small budget of queries, which two benchmarks measure beside those of the configs."""

from typing import Any

# In place of the config's own values: few directions, no rechecks, later cycles that start from confident hits alone, a
# tenth of the candidates dropped, and no more of these than a cloud needs. 8 queries for each point instead of 76.
IN_BRIEF: dict[str, Any] = {
    "num_directions": 3, "recheck": (), "oversampling": -0.34, "resample": 1.0, "outliers": 0.1,
}  # fmt: skip
