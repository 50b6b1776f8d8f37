"""A page of text, tables and figures, written as Markdown and as one self-contained HTML file.

Text may hold `code`, **bold**, [links](file) and <sub>subscripts</sub>; everything else is literal. The HTML file
holds its style and its figures (base64) and loads nothing.
"""

import base64
import html
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

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
    """A file of the page; `alt` says what it shows to those who do not see it."""

    name: str
    caption: str
    alt: str


@dataclass(frozen=True)
class Section:
    """A heading and what stands below it: paragraphs (str), bullet lists (tuples of str), tables, figures."""

    title: str
    blocks: Sequence["str | tuple[str, ...] | Table | Figure"]


@dataclass(frozen=True)
class Page:
    """The whole report; `files` are the figures' contents by name."""

    title: str
    lead: Sequence[str]
    sections: Sequence[Section]
    files: Mapping[str, bytes] = field(default_factory=dict)


def markdown(page: Page) -> str:
    """GitHub-flavoured Markdown with the figures as files beside it."""
    parts = [f"# {page.title}", *page.lead]
    for section in page.sections:
        parts.append(f"## {section.title}")
        parts += [_markdown_block(block) for block in section.blocks]
    return "\n\n".join(parts) + "\n"


def _markdown_block(block: "str | tuple[str, ...] | Table | Figure") -> str:
    if isinstance(block, Table):
        return _markdown_table(block)
    if isinstance(block, Figure):
        return f"![{_plain(block.alt)}]({block.name})\n\n*{block.caption}*"
    return "\n".join(f"- {item}" for item in block) if isinstance(block, tuple) else block


def _markdown_table(table: Table) -> str:
    """One header line, because Markdown has no column groups: the group's name goes before the column's."""
    groups = [name for name, width, _ in table.groups for _ in range(width)]
    head = [f"{group} {name}".strip() for group, name in zip(groups, table.header, strict=True)]
    ruler = [":--" if i < table.labels else "--:" for i in range(len(head))]
    lines = [head, ruler, *([_markdown_cell(cell) for cell in row] for row in table.rows)]
    text = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    return f"{text}\n\n*{table.caption}*"


def _markdown_cell(cell: Cell | str) -> str:
    text = (cell if isinstance(cell, str) else cell.text).replace("|", "\\|")
    return f"**{text}**" if isinstance(cell, Cell) and cell.best else text


def _plain(text: str) -> str:
    return re.sub(r"[`*\[\]]|</?sub>", "", text)


def html_page(page: Page) -> str:
    """One HTML file without any reference to another file, but for links that the reader may follow."""
    body = [f"<h1>{_inline(page.title)}</h1>", *(f'<p class="lead">{_inline(text)}</p>' for text in page.lead)]
    anchors = [re.sub(r"[^a-z0-9]+", "-", _plain(section.title).lower()).strip("-") for section in page.sections]
    links = (f'<a href="#{a}">{_inline(s.title)}</a>' for a, s in zip(anchors, page.sections, strict=True))
    body.append(f"<nav>{''.join(links)}</nav>")
    for anchor, section in zip(anchors, page.sections, strict=True):
        blocks = "\n".join(_html_block(block, page.files) for block in section.blocks)
        body.append(f'<section id="{anchor}">\n<h2>{_inline(section.title)}</h2>\n{blocks}\n</section>')
    head = '<meta charset="utf-8">\n<meta name="viewport" content="width=device-width, initial-scale=1">\n'
    head += f"<title>{html.escape(_plain(page.title))}</title>\n<style>{_STYLE}</style>"
    text = "\n".join(body)
    frame = f"<head>\n{head}\n</head>\n<body>\n<main>\n{text}\n</main>\n</body>"
    return f'<!doctype html>\n<html lang="en">\n{frame}\n</html>\n'


def _html_block(block: "str | tuple[str, ...] | Table | Figure", files: Mapping[str, bytes]) -> str:
    if isinstance(block, Table):
        return _html_table(block)
    if isinstance(block, Figure):
        media = _MEDIA_TYPES[block.name.rpartition(".")[2]]
        data = base64.b64encode(files[block.name]).decode("ascii")
        image = f'<img alt="{html.escape(_plain(block.alt), quote=True)}" src="data:{media};base64,{data}">'
        return f"<figure>{image}<figcaption>{_inline(block.caption)}</figcaption></figure>"
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


_STYLE = """
:root{--ink:#20242c;--soft:#5a616d;--line:#dfe3e9;--ref:#f4f5f8;--link:#1f5fa8} *{box-sizing:border-box}
body{margin:0;background:#fff;color:var(--ink);font:15.5px/1.6 system-ui,-apple-system,"Segoe UI",Roboto,"Helvetica
Neue", "Noto Sans",Arial,sans-serif;-webkit-font-smoothing:antialiased} main{max-width:1240px;margin:0
auto;padding:44px 28px 80px} h1{font-size:29px;line-height:1.2;letter-spacing:-.015em;margin:0 0 12px}
h2{font-size:20px;letter-spacing:-.01em;margin:52px 0 10px;padding-top:14px;border-top:1px solid var(--line)}
p,ul{max-width:76ch;margin:10px 0} ul{padding-left:20px}li{margin:4px 0} .lead{font-size:16.5px;color:#353b46}
nav{display:flex;flex-wrap:wrap;gap:4px 18px;margin:22px 0 0;font-size:14px}
a{color:var(--link);text-decoration:none}a:hover{text-decoration:underline} code{font:.88em
ui-monospace,SFMono-Regular,Menlo,Consolas,"DejaVu Sans Mono",monospace;background:var(--ref); padding:1px
4px;border-radius:3px} figure{margin:18px 0 26px}
figcaption{max-width:92ch;margin-top:8px;font-size:13.5px;line-height:1.5;color:var(--soft)}
img{display:block;max-width:100%;height:auto} .scroll{overflow-x:auto}
table{border-collapse:collapse;font-size:13px;line-height:1.25;font-variant-numeric:tabular-nums lining-nums;
border-top:1.5px solid var(--ink);border-bottom:1.5px solid var(--ink)} th,td{padding:5px
8px;text-align:right;white-space:nowrap} th{font-weight:600;color:#353b46;vertical-align:bottom} thead tr:last-child
th{border-bottom:1px solid var(--ink)} th.grp{text-align:center;border-bottom:1px solid var(--line)}
.t{text-align:left}.grp.t{text-align:left} td:first-child{font-weight:600} .g{border-left:1px solid var(--line)}
.ref{background:var(--ref);color:#4a515d} tr.rule td{border-bottom:1px solid var(--line)} tbody tr:hover
td{background:#eef3fa} sub{font-size:.74em;line-height:0} @media
print{main{padding:0}section{break-inside:avoid-page}}
"""
