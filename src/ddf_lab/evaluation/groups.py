"""Groups of test shapes, which tables keep apart: categories, or of a data set of both sources the real and the
procedural shapes of each.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from ddf.data.public import manifest

REAL, PROCEDURAL = "real", "procedural"


def names(index: Mapping[str, Any]) -> dict[str, str]:
    """The category of each group: real ones first, those without test shapes left out."""
    if index["source"] != "both":
        return {category: category for category in index["categories"]}
    present = {name for category in index["categories"] for name in of_shapes(index, category).values()}
    every = {f"{kind} {category}": category for kind in (REAL, PROCEDURAL) for category in index["categories"]}
    return {name: category for name, category in every.items() if name in present}


def of_shapes(index: Mapping[str, Any], category: str, split: str = "test") -> dict[str, str]:
    """The group of every shape of a category that tests, or that trains or validates, by id."""
    own = [shape["id"] for shape in index["categories"][category]["shapes"] if shape[f"{split}_views"]]
    if index["source"] != "both":
        return dict.fromkeys(own, category)
    return {shape: f"{REAL if manifest.is_real(shape) else PROCEDURAL} {category}" for shape in own}


def makers(rows: Sequence[manifest.Row]) -> list[str]:
    """Who made real shapes, for credit: a sentence for each licence, with every name once."""
    licences = sorted({row.licence for row in rows})
    names = {licence: sorted({row.creator for row in rows if row.licence == licence}) for licence in licences}
    return [f"{licence}: {', '.join(own)}." for licence, own in names.items()]
