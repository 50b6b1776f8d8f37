"""The manifest of public shapes: one row a shape, in `manifest.csv`, looked at one by one.

Splits are frozen: test shapes are chosen once and used for no choice. Another shape is of validation where the first
eight hexadecimal digits of its id's SHA-256 are under 15 % of their range, else of training.
"""

import csv
import functools
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

SPLITS = ("train", "validation", "test")


@dataclass(frozen=True)
class Row:
    """One shape.

    path: inside its package. looks: a folder of the package with its pictures, ending in /, where they are not beside
    the mesh. axes: of the file, that become X (ahead), Y (up) and Z. wheels: of axles that the file lacks, as (x, y, z,
    radius, width) in its unit and those axes. licence: as SPDX names it.
    """

    id: str
    category: str
    split: str
    package: str
    path: str
    looks: str
    axes: str
    wheels: tuple[tuple[float, ...], ...]
    licence: str
    creator: str

    @property
    def free(self) -> bool:
        """Whether its licence asks for credit at most: what it taught may be given on under any other."""
        return self.licence.startswith(("CC0-", "CC-BY-3.0"))


@functools.cache
def rows() -> tuple[Row, ...]:
    """All shapes, by category and id."""
    text = Path(__file__).with_name("manifest.csv").read_text(encoding="utf-8")
    return tuple(Row(**{**entry, "wheels": _axles(entry["wheels"])}) for entry in csv.DictReader(text.splitlines()))


def _axles(text: str) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(map(float, axle.split())) for axle in text.split(";") if axle)


def of(categories: Collection[str]) -> list[Row]:
    """The shapes of some categories."""
    return [row for row in rows() if row.category in categories]


def wanted(package: str) -> set[str]:
    """What the rows need of a package, as `packages` asks for it."""
    own = [row for row in rows() if row.package == package]
    return {name for row in own for name in (row.path, row.looks) if name}
