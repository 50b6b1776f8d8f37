"""A page of text, tables and figures, written as Markdown (kept in git) and as one self-contained HTML file (not kept).

Text may hold `code`, **bold**, [links](file) and <sub>subscripts</sub>; everything else is literal. The HTML file
holds its style and its figures (base64) and loads nothing.
"""

import base64
import html
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from ddf.core import storage

_MEDIA_TYPES = {"png": "image/png", "svg": "image/svg+xml", "webp": "image/webp"}


@dataclass(frozen=True)
class Cell:
    """A value as printed; `best` is set in bold, `note` appears when the pointer rests on it (HTML only)."""

    text: str
    best: bool = False
    note: str = ""


@dataclass(frozen=True)
class Table:
    """Columns in groups: `groups` gives (name, number of columns, shaded); rows are label cells and then values.

    labels: how many leading columns are text, aligned left. rule_every: a line below every so many rows.
    """

    caption: str
    groups: Sequence[tuple[str, int, bool]]
    header: Sequence[str]
    rows: Sequence[Sequence[Cell | str]]
    labels: int = 1
    rule_every: int = 0


@dataclass(frozen=True)
class Figure:
    """A picture of the page, a file beside it; `alt` says what it shows to those who do not see it.

    content: of the file; empty for one that is there already.
    """

    name: str
    caption: str
    alt: str
    content: bytes = b""


@dataclass(frozen=True)
class Live:
    """A page inside the page, a file beside it that is loaded when its caption is opened.

    It is in the HTML file alone: HTML is not kept in git, so that Markdown could only point at nothing.
    """

    name: str
    caption: str
    content: bytes


Block = str | tuple[str, ...] | Table | Figure | Live  # a paragraph, a bullet list, a table, a picture, a page


@dataclass(frozen=True)
class Section:
    """A heading and what stands below it: a picture first where there is one, then numbers."""

    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Page:
    """The whole report.

    Args:
      lead: what stands before the first section: the verdict, a picture, how the page was made.
      files: contents of figures by name that the figures themselves do not hold.
    """

    title: str
    lead: Sequence[Block]
    sections: Sequence[Section]
    files: Mapping[str, bytes] = field(default_factory=dict)

    def contents(self) -> dict[str, bytes]:
        """Contents of figures and of live pages by file name."""
        blocks = [*self.lead, *(block for section in self.sections for block in section.blocks)]
        own = {block.name: block.content for block in blocks if isinstance(block, Figure | Live) and block.content}
        return {**self.files, **own}


MAX_COLUMNS = 8  # of a table: more cannot be read on a page


def split(table: Table) -> list[Table]:
    """The table in parts of at most `MAX_COLUMNS` columns; each has the label columns, the last one the caption.

    Column groups are not kept together: for tables without them.
    """
    free = range(table.labels, len(table.header))
    step = MAX_COLUMNS - table.labels
    chunks = [[*range(table.labels), *free[i : i + step]] for i in range(0, len(free), step)]
    if len(chunks) < 2:
        return [table]
    parts = []
    for number, columns in enumerate(chunks, start=1):
        caption = table.caption if number == len(chunks) else f"Part {number} of {len(chunks)}."
        rows = [[row[i] for i in columns] for row in table.rows]
        header = [table.header[i] for i in columns]
        parts.append(replace(table, caption=caption, groups=[("", len(columns), False)], header=header, rows=rows))
    return parts


def paragraph(text: str, **values: object) -> str:
    """One paragraph on one line, its {names} replaced."""
    return " ".join(text.split()).format(**values)


def write(page: Page, folder: Path) -> None:
    """README.md, the figures, index.html that holds them, and live pages."""
    for name, content in page.contents().items():
        storage.write_bytes(folder / name, content)
    storage.write_text(folder / "README.md", markdown(page))
    storage.write_text(folder / "index.html", html_page(page))


def markdown(page: Page) -> str:
    """GitHub-flavoured Markdown with the figures as files beside it."""
    parts = [f"# {page.title}", *map(_markdown_block, page.lead)]
    for section in page.sections:
        parts.append(f"## {section.title}")
        parts += [_markdown_block(block) for block in section.blocks]
    return "\n\n".join(filter(None, parts)) + "\n"


def _markdown_block(block: Block) -> str:
    if isinstance(block, Live):
        return ""
    if isinstance(block, Table):
        return _markdown_table(block)
    if isinstance(block, Figure):
        return f"![{_plain(block.alt)}]({block.name})\n\n{_slanted(block.caption)}"
    return "\n".join(f"- {item}" for item in block) if isinstance(block, tuple) else block


def _markdown_table(table: Table) -> str:
    """One header line, because Markdown has no column groups: the group's name goes before the column's."""
    groups = [name for name, width, _ in table.groups for _ in range(width)]
    head = [f"{group} {name}".strip() for group, name in zip(groups, table.header, strict=True)]
    ruler = [":--" if i < table.labels else "--:" for i in range(len(head))]
    lines = [head, ruler, *([_markdown_cell(cell) for cell in row] for row in table.rows)]
    text = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    return f"{text}\n\n{_slanted(table.caption)}"


def _slanted(caption: str) -> str:
    """A star of a name, as of v*, ends nothing."""
    return "*" + re.sub(r"(?<=\w)\*(?!\*)", r"\\*", caption) + "*"


def _markdown_cell(cell: Cell | str) -> str:
    text = (cell if isinstance(cell, str) else cell.text).replace("|", "\\|")
    return f"**{text}**" if isinstance(cell, Cell) and cell.best else text


def _plain(text: str) -> str:
    return re.sub(r"[`*\[\]]|</?sub>", "", text)


def html_page(page: Page) -> str:
    """One HTML file without any reference to another file, but for what the reader may open: links and live pages."""
    files = page.contents()
    body = [f"<h1>{_inline(page.title)}</h1>"]
    for block in page.lead:
        body.append(f'<p class="lead">{_inline(block)}</p>' if isinstance(block, str) else _html_block(block, files))
    anchors = [re.sub(r"[^a-z0-9]+", "-", _plain(section.title).lower()).strip("-") for section in page.sections]
    links = (f'<a href="#{a}">{_inline(s.title)}</a>' for a, s in zip(anchors, page.sections, strict=True))
    body.append(f"<nav>{''.join(links)}</nav>")
    for anchor, section in zip(anchors, page.sections, strict=True):
        blocks = "\n".join(_html_block(block, files) for block in section.blocks)
        body.append(f'<section id="{anchor}">\n<h2>{_inline(section.title)}</h2>\n{blocks}\n</section>')
    head = '<meta charset="utf-8">\n<meta name="viewport" content="width=device-width, initial-scale=1">\n'
    head += f"<title>{html.escape(_plain(page.title))}</title>\n<style>{_STYLE}</style>"
    text = "\n".join(body)
    frame = f"<head>\n{head}\n</head>\n<body>\n<main>\n{text}\n</main>\n</body>"
    return f'<!doctype html>\n<html lang="en">\n{frame}\n</html>\n'


def _html_block(block: Block, files: Mapping[str, bytes]) -> str:
    if isinstance(block, Table):
        return _html_table(block)
    if isinstance(block, Figure):
        media = _MEDIA_TYPES[block.name.rpartition(".")[2]]
        data = base64.b64encode(files[block.name]).decode("ascii")
        image = f'<img alt="{html.escape(_plain(block.alt), quote=True)}" src="data:{media};base64,{data}">'
        return f"<figure>{image}<figcaption>{_inline(block.caption)}</figcaption></figure>"
    if isinstance(block, Live):
        address, caption = html.escape(block.name, quote=True), html.escape(_plain(block.caption), quote=True)
        frame = f'<iframe title="{caption}" data-src="{address}"></iframe>'
        alone = f'<p><a href="{address}">In a window of its own</a></p>'
        return f"<details {_LOAD}><summary>{_inline(block.caption)}</summary>{frame}{alone}</details>"
    if isinstance(block, tuple):
        return "<ul>" + "".join(f"<li>{_inline(item)}</li>" for item in block) + "</ul>"
    return f"<p>{_inline(block)}</p>"


def _html_table(table: Table) -> str:
    classes: list[str] = []
    for group, (_, width, shaded) in enumerate(table.groups):
        for i in range(width):
            first = "g" if i == 0 and group > 0 else ""
            kinds = (first, "ref" if shaded else "", "t" if len(classes) < table.labels else "")
            classes.append(" ".join(filter(None, kinds)))
    head = ""
    if any(name for name, _, _ in table.groups):
        cells, column = [], 0
        for name, width, _ in table.groups:
            cells.append(f'<th colspan="{width}" class="grp {classes[column]}">{_inline(name)}</th>')
            column += width
        head += f"<tr>{''.join(cells)}</tr>"
    heads = (f'<th class="{kind}">{_inline(name)}</th>' for name, kind in zip(table.header, classes, strict=True))
    head += f"<tr>{''.join(heads)}</tr>"
    body = []
    for number, row in enumerate(table.rows, start=1):
        ends = table.rule_every > 0 and number % table.rule_every == 0 and number < len(table.rows)
        rule = ' class="rule"' if ends else ""
        body.append(f"<tr{rule}>" + "".join(map(_html_cell, row, classes)) + "</tr>")
    text = f"<table><thead>{head}</thead><tbody>{''.join(body)}</tbody></table>"
    return f'<figure><div class="scroll">{text}</div><figcaption>{_inline(table.caption)}</figcaption></figure>'


def _html_cell(cell: Cell | str, kind: str) -> str:
    cell = Cell(cell) if isinstance(cell, str) else cell
    text = f"<b>{_inline(cell.text)}</b>" if cell.best else _inline(cell.text)
    note = f' title="{html.escape(cell.note, quote=True)}"' if cell.note else ""
    return f'<td class="{kind}"{note}>{text}</td>'


def _inline(text: str) -> str:
    """Escaped, but for the marks that text may hold."""
    text = html.escape(text, quote=False)
    text = re.sub(r"&lt;(/?)sub&gt;", r"<\1sub>", text)
    text = re.sub(r"`([^`]+)`", r"<code>\1</code>", text)
    text = re.sub(r"\*\*([^*]+)\*\*", r"<strong>\1</strong>", text)
    return re.sub(r"\[([^\]]+)\]\(([^)\s:]+)\)", r'<a href="\2">\1</a>', text)


# An <iframe loading="lazy"> would not do: browsers load it with its <details> still closed.
_LOAD = 'ontoggle="const frame=this.querySelector(`iframe`);frame.src||=frame.dataset.src"'
_STYLE = """
:root{color-scheme:light dark;--page:#fff;--ink:#20242c;--soft:#5a616d;--line:#dfe3e9;--ref:#f4f5f8;--hover:#eef3fa;
--link:#1f5fa8}
@media (prefers-color-scheme:dark){:root{--page:#15181d;--ink:#e4e7ec;--soft:#a3abb8;--line:#333944;--ref:#1f242c;
--hover:#262d38;--link:#7fb2ee}}
*{box-sizing:border-box}
body{margin:0;background:var(--page);color:var(--ink);font:16px/1.6 system-ui,-apple-system,"Segoe UI",Roboto,
"Helvetica Neue","Noto Sans",Arial,sans-serif;-webkit-text-size-adjust:100%;overflow-wrap:break-word}
main{max-width:1040px;margin:0 auto;padding:40px 24px 80px}
h1{font-size:28px;line-height:1.2;margin:0 0 12px}
h2{font-size:20px;margin:48px 0 10px;padding-top:14px;border-top:1px solid var(--line)}
p,ul{max-width:76ch;margin:10px 0} ul{padding-left:20px} li{margin:4px 0} .lead:first-of-type{font-size:18px}
nav{display:flex;flex-wrap:wrap;gap:6px 18px;margin:22px 0 0;font-size:15px}
a{color:var(--link);text-decoration:none} a:hover{text-decoration:underline}
code{font:.88em ui-monospace,SFMono-Regular,Menlo,Consolas,"DejaVu Sans Mono",monospace;background:var(--ref);
padding:1px 4px;border-radius:3px}
figure{margin:18px 0 26px}
figcaption{max-width:84ch;margin-top:8px;font-size:14px;line-height:1.5;color:var(--soft)}
img{display:block;max-width:100%;height:auto;background:#fff;border-radius:4px}
details{margin:14px 0} summary{cursor:pointer;color:var(--link)}
iframe{display:block;width:100%;height:820px;max-height:92vh;margin:10px 0 6px;border:1px solid var(--line);
border-radius:4px}
.scroll{overflow-x:auto}
table{border-collapse:collapse;font-size:14px;line-height:1.25;font-variant-numeric:tabular-nums lining-nums;
border-top:1.5px solid var(--ink);border-bottom:1.5px solid var(--ink)}
th,td{padding:5px 9px;text-align:right;white-space:nowrap} th{font-weight:600;vertical-align:bottom}
thead tr:last-child th{border-bottom:1px solid var(--ink)} th.grp{text-align:center;border-bottom:1px solid var(--line)}
.t,.grp.t{text-align:left} td.t:first-child{font-weight:600} .g{border-left:1px solid var(--line)}
.ref{background:var(--ref);color:var(--soft)} tr.rule td{border-bottom:1px solid var(--line)}
tbody tr:hover td{background:var(--hover)} sub{font-size:.74em;line-height:0}
@media (max-width:600px){main{padding:20px 14px 48px} h1{font-size:23px} h2{margin-top:36px} th,td{padding:5px 7px}}
@media print{main{padding:0} section{break-inside:avoid-page}}
"""
