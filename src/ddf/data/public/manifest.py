"""The manifest of public shapes: one row a shape, in `manifest.csv`, looked at one by one; and those of own shapes.

Splits are frozen: test shapes are chosen once and used for no choice. Another shape is of validation where the first
eight hexadecimal digits of its id's SHA-256 are under 15 % of their range, else of training. Of the family of a test
shape, which is its maker or its type of aircraft, an experiment uses test shapes alone.
"""

import csv
import functools
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from ddf.core import checks

FILE = "manifest.csv"
SPLITS = ("train", "validation", "test")
OWN = "own"  # package of the shapes of `ddf shapes add`; their ids begin with it
# Of an own shape. file to source are as given, the rest is found; `add` reads again what was edited.
COLUMNS = tuple("id category split file up front licence author source faces pieces openings note checksum".split())
FREE = ("CC0-", "CC-BY-3.0", "CC-BY-4.0", "MIT", "Apache-2.0")


@dataclass(frozen=True)
class Row:
    """One shape.

    path: inside its package. looks: a folder of the package with its pictures, ending in /, where they are not beside
    the mesh. axes: of the file, that become X (ahead), Y (up) and Z. wheels: of axles that the file lacks, as (x, y, z,
    radius, width) in its unit and those axes. licence: as SPDX names it. checksum, source: SHA-256
    of an own shape's mesh, and where that is from. family: of a chosen test shape and those related to it, else empty.
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
    checksum: str = ""
    source: str = ""
    family: str = ""

    @property
    def free(self) -> bool:
        """Whether its licence asks for credit at most: what it taught may be given on under any other."""
        return self.licence.startswith(FREE)


@functools.cache
def rows() -> tuple[Row, ...]:
    """All shapes, by category and id."""
    text = Path(__file__).with_name(FILE).read_text(encoding="utf-8")
    found = []
    for entry in csv.DictReader(text.splitlines()):
        wheels = tuple(tuple(map(float, axle.split())) for axle in entry["wheels"].split(";") if axle)
        found.append(Row(**{**entry, "wheels": wheels}))
    return tuple(found)


def is_real(name: str) -> bool:
    """Whether a shape, or a variation of one, is public or own, not procedural."""
    return name.startswith(f"{OWN}-") or name.partition("--")[0] in {row.id for row in rows()}


def entries(path: Path, needed: Collection[str] = COLUMNS) -> list[dict[str, str]]:
    """The lines of a manifest of own meshes, in COLUMNS; InputError where it is none, or lacks what is needed."""
    try:
        table = csv.DictReader(path.read_text(encoding="utf-8-sig").splitlines())
        if set(needed) <= set(table.fieldnames or ()):
            return [{name: (line.get(name) or "").strip() for name in COLUMNS} for line in table]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise checks.InputError(f"{path}: no table in UTF-8, as `ddf shapes add` writes it ({error})") from error
    raise checks.InputError(f"{path}: must be a table with the columns {', '.join(needed)}")


def own(folder: Path, categories: Collection[str]) -> list[Row]:
    """The shapes of some categories in a folder of `ddf shapes add`; InputError as `entries`, or of a wrong split."""
    found = []
    for each in entries(folder.expanduser() / FILE):
        name, category, split = each["id"], each["category"], each["split"]
        if split not in SPLITS:
            raise checks.InputError(f"{folder / FILE}: {name}: split must be {', '.join(SPLITS)}; got {split!r}")
        place = (OWN, f"{category}/{name}.ply", "", "x y z", ())
        found.append(
            Row(name, category, split, *place, each["licence"], each["author"], each["checksum"], each["source"])
        )
    return [row for row in found if row.category in categories]


def of(categories: Collection[str]) -> list[Row]:
    """The shapes of some categories."""
    return [row for row in rows() if row.category in categories]


def unrelated(found: Collection[Row]) -> list[Row]:
    """Test shapes, and of the others those of other families."""
    tested = {(row.category, row.family) for row in found if row.family and row.split == "test"}
    return [row for row in found if row.split == "test" or (row.category, row.family) not in tested]


def wanted(package: str) -> set[str]:
    """What the rows need of a package, as `packages` asks for it."""
    own = [row for row in rows() if row.package == package]
    return {name for row in own for name in (row.path, row.looks) if name}
