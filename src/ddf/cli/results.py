"""A command's result as one JSON object for scripts, or as a short table with a verdict for people.

What is not known, the mean of nothing say, is NaN in Python, null in JSON and "–" in the table.
"""

import json
import logging
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

FOR_PEOPLE = ("table", "verdict")  # keys of a result that JSON leaves out
NOTHING = "–"
_LONG = 8  # items of a list from which on only their number is shown


def json_line(result: Mapping[str, Any]) -> str:
    """The result on one line; NaN and infinity, which JSON lacks, are null."""
    plain = {key: value for key, value in result.items() if key not in FOR_PEOPLE}
    return json.dumps(_jsonable(plain), allow_nan=False) + "\n"


def text(result: Mapping[str, Any]) -> str:
    """The table, of what the result holds where it has none, and the verdict."""
    shown = result.get("table", {key: value for key, value in result.items() if key not in FOR_PEOPLE})
    lines = list(shown) if isinstance(shown, list) else _lines(shown)
    return "\n".join([*lines, *([result["verdict"]] if "verdict" in result else [])]) + "\n"


def show_parts() -> None:
    """Show what the package logs of its parts on stderr, a line each."""
    logging.basicConfig(format="%(message)s")
    logging.getLogger("ddf").setLevel(logging.INFO)


def grid(header: Sequence[str], rows: Sequence[Sequence[Any]]) -> list[str]:
    """Lines of a table with a header; columns of numbers are set right."""
    if not rows:
        return []
    cells = [[cell(value) for value in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(header, *cells, strict=True)]
    right = [all(_is_number(row[i]) for row in rows) for i in range(len(header))]
    return [
        "  ".join(f"{word:>{width}}" if is_right else f"{word:<{width}}" for word, width, is_right in columns).rstrip()
        for columns in (list(zip(row, widths, right, strict=True)) for row in (list(header), *cells))
    ]


def cell(value: Any) -> str:
    """One value as people read it: 4,812 and 0.01234, yes and no, "–" for what is not known."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return NOTHING
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}"
    if isinstance(value, float):
        return f"{value:.4g}" if abs(value) < 1e4 or math.isinf(value) else f"{value:,.0f}"
    if isinstance(value, list | tuple):
        words = [cell(item) for item in value]
        return (f"{len(words):,} in all" if len(words) > _LONG else ", ".join(words)) or "none"
    return str(value)


def left_out(remarks: Sequence[str]) -> str:
    """The end of a verdict on a mesh: what its reader left out; nothing where it took all."""
    return f"; of the file: {'; '.join(remarks)}" if remarks else ""


def _lines(result: Mapping[str, Any]) -> list[str]:
    pairs = list(_flat(result))
    width = max((len(name) for name, _ in pairs), default=0)
    return [f"{name:<{width}}  {cell(value)}" for name, value in pairs]


def _flat(result: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in result.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _is_number(value: Any) -> bool:
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool))


def _jsonable(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _jsonable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_jsonable(item) for item in value]
    if hasattr(value, "tolist"):
        return _jsonable(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)
