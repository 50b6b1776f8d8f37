"""A way of drawing clouds for a small budget of queries, which two benchmarks measure beside those of the configs."""

from typing import Any

# In place of the config's own values: few directions, no rechecks, later cycles that start close to confident hits
# alone, and with their mirror images, which the config has, hardly more candidates than a cloud needs. 4 queries for
# each point instead of 47.
IN_BRIEF: dict[str, Any] = {
    "num_directions": 3, "recheck": (), "oversampling": -0.67, "resample": 1.0, "jitter": 0.05,
}  # fmt: skip
