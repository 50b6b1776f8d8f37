"""From measured costs to the published setting: 18,319 shapes of chairs, planes and cars, configs/paper.yaml.

Arithmetic alone: every cost comes from a measurement, every count from the split or from the experiment file.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

LINES = {"chair": (27_112, 6_778), "plane": (16_180, 4_045), "car": (29_984, 7_496)}
"""Images of the split of Pixel2Mesh on ShapeNet v1, train and test: lines of its train_list.txt and test_list.txt."""
VIEWS = 5  # of each shape, in the split
SECONDS_PER_HOUR = 3600


@dataclass(frozen=True)
class Split:
    """How much of everything one or more categories have."""

    shapes: int
    train_images: int
    test_images: int
    pairs: int  # of a test shape and a training shape of the same category: what the oracle row ranks

    @classmethod
    def of(cls, lines: Mapping[str, tuple[int, int]], views: int = VIEWS) -> "Split":
        """The sums over categories; a shape on both sides of the split counts on the side with more of its views."""
        return cls(
            shapes=sum(sum(sides) // views for sides in lines.values()),
            train_images=sum(train for train, _ in lines.values()),
            test_images=sum(test for _, test in lines.values()),
            pairs=sum(round(train / views) * round(test / views) for train, test in lines.values()),
        )


def slope(sizes: Sequence[int], values: Sequence[float]) -> float:
    """Growth of a value per shape between the smallest and the largest size, in the value's unit."""
    (low, first), (high, last) = min(zip(sizes, values, strict=True)), max(zip(sizes, values, strict=True))
    return (last - first) / (high - low)


def map_hours(cpu_seconds: float, units: int, cores: int) -> float:
    """Hours of a map over independent units, taken to be linear in the cores: CPU seconds per unit x units / cores."""
    return cpu_seconds * units / cores / SECONDS_PER_HOUR


def training_hours(step_seconds: float, threads: int, steps: int, trainings: int, cores: int) -> float:
    """Hours of equal trainings on `cores`, as many at a time as have `threads` cores each, at the measured step time.

    One training is not taken to get faster with more cores than it was measured on.
    """
    rounds = -(-trainings // max(1, cores // threads))
    return rounds * steps * step_seconds / SECONDS_PER_HOUR


def find_step(record: Mapping[str, Any] | None, model: str, device: str) -> Mapping[str, Any] | None:
    """The row on one model (`what` begins with its name) and one device (`device` of `size`, `cpu` where there is
    none), of reports/bench/full_size_step.json or of the GPU check; None without a record or such a row.
    """
    rows = [] if record is None else record["rows"]
    found = (row for row in rows if row["what"].startswith(model) and row["size"].get("device", "cpu") == device)
    return next(found, None)


def bytes_of_training(parameters: int) -> int:
    """Disk of one training: the model, and a checkpoint of it with both moments of Adam, all float32."""
    return 4 * parameters * (1 + 3)


def bytes_of_ddf_clouds(large: int, small: int) -> int:
    """L and S of DDF of an image after one and after all cycles, float32 x 3."""
    return 12 * 2 * (large + small)


def bytes_of_clouds(large: int, small: int, features: int, train_images: int, test_images: int) -> int:
    """Disk of the predicted clouds: `bytes_of_ddf_clouds`, L and S of PC-SIREN, float32 x 3; and the encoder's features
    of every image.
    """
    clouds = bytes_of_ddf_clouds(large, small) + 12 * (large + small)
    return clouds * test_images + 4 * features * (train_images + test_images)


def together(parts: Sequence[float | None]) -> float | None:
    """The sum; None when a part is not known."""
    known = [part for part in parts if part is not None]
    return sum(known) if len(known) == len(parts) else None
