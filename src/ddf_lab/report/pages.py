"""A page of text, tables and figures, as Markdown with its figures as files beside it.

Text may hold what Markdown's text may: `code`, **bold**, [links](file), and <sub>subscripts</sub>.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ddf.core import storage

MAX_COLUMNS = 8  # of a table: more cannot be read on a page


@dataclass(frozen=True)
class Cell:
    """A value as printed; `best` is set in bold."""

    text: str
    best: bool = False


@dataclass(frozen=True)
class Table:
    """Rows of label cells and then values; `labels` is how many leading columns are text, aligned left."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[Cell | str]]
    labels: int = 1


@dataclass(frozen=True)
class Figure:
    """A picture of the page, a file beside it; `alt` says what it shows to those who do not see it."""

    name: str
    caption: str
    alt: str
    content: bytes


Block = str | tuple[str, ...] | Table | Figure  # a paragraph, a bullet list, a table, a picture


@dataclass(frozen=True)
class Section:
    """A heading and what stands below it, pictures first; None is left out. folded: seen on a click."""

    title: str
    blocks: Sequence[Block | None]
    folded: bool = False


@dataclass(frozen=True)
class Page:
    """The whole report; `lead` stands before the first section: the verdict, a picture, how the page was made."""

    title: str
    lead: Sequence[Block]
    sections: Sequence[Section]


def write(page: Page, folder: Path) -> None:
    """README.md, and the figures."""
    for block in (*page.lead, *(block for section in page.sections for block in section.blocks)):
        if isinstance(block, Figure):
            storage.write_bytes(folder / block.name, block.content)
    storage.write_text(folder / "README.md", markdown(page))


def markdown(page: Page) -> str:
    """GitHub-flavoured Markdown."""
    parts = [f"# {page.title}", *map(_block, page.lead)]
    for section in page.sections:
        blocks = [_block(block) for block in section.blocks if block]
        if section.folded:
            blocks = ["<details markdown><summary>Open</summary>", *blocks, "</details>"]
        parts += [f"## {section.title}", *blocks]
    return "\n\n".join(parts) + "\n"


def _block(block: Block) -> str:
    if isinstance(block, Table):
        ruler = [":--" if i < block.labels else "--:" for i in range(len(block.header))]
        lines = [block.header, ruler, *([_cell(cell) for cell in row] for row in block.rows)]
        return "\n".join("| " + " | ".join(line) + " |" for line in lines) + f"\n\n{_slanted(block.caption)}"
    if isinstance(block, Figure):
        alt = re.sub(r"[`*\[\]]|</?sub>", "", block.alt)
        return f"![{alt}]({block.name})\n\n{_slanted(block.caption)}"
    return "\n".join(f"- {item}" for item in block) if isinstance(block, tuple) else block


def _slanted(caption: str) -> str:
    """The caption in italics; a star within a name, such as v*, ends nothing."""
    return "*" + re.sub(r"(?<=\w)\*(?!\*)", r"\\*", caption) + "*"


def _cell(cell: Cell | str) -> str:
    text = (cell if isinstance(cell, str) else cell.text).replace("|", "\\|")
    return f"**{text}**" if isinstance(cell, Cell) and cell.best else text
