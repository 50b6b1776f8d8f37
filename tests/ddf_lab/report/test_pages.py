"""Pages as Markdown and HTML: marks, escapes, tables, nothing loaded from outside."""

import base64
import html.parser
import re

import pytest

from ddf_lab.report import pages

_TABLE = pages.Table(
    "A caption with <sub>x</sub>",
    [("", 1, False), ("ours", 2, False), ("theirs", 1, True)],
    ["", "a|b", "c", "c"],
    [["one", pages.Cell("1.0", best=True), pages.Cell("2.0", note='3 "images"'), "4"], ["two", "5", "6", "7"]],
    rule_every=1,
)


def _page(*blocks):
    return pages.Page("Title & <b>", ["Lead `code`"], [pages.Section("First part", blocks)], {"a.svg": b"<svg/>"})


class _Balance(html.parser.HTMLParser):
    """Fails on tags that are not closed in order; collects attributes."""

    def __init__(self):
        super().__init__()
        self.open, self.attributes = [], []

    def handle_starttag(self, tag, attrs):
        self.attributes += [(tag, *pair) for pair in attrs]
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def _parse(text):
    parser = _Balance()
    parser.feed(text)
    assert parser.open == []
    return parser


def test_markdown_table_has_one_line_per_row_and_keeps_bold():
    lines = pages.markdown(_page(_TABLE)).splitlines()
    start = lines.index("|  | ours a|b | ours c | theirs c |")
    assert lines[start + 1] == "| :-- | --: | --: | --: |"
    assert lines[start + 2 : start + 4] == ["| one | **1.0** | 2.0 | 4 |", "| two | 5 | 6 | 7 |"]
    assert "*A caption with <sub>x</sub>*" in lines


def test_html_table_has_groups_notes_and_shaded_columns():
    text = pages.html_page(_page(_TABLE))
    assert '<th colspan="2" class="grp g">ours</th>' in text and '<th colspan="1" class="grp g ref">theirs</th>' in text
    assert '<td class="g"><b>1.0</b></td><td class="" title="3 &quot;images&quot;">2.0</td>' in text
    assert text.count('<tr class="rule">') == 1  # not after the last row
    _parse(text)


def test_text_is_escaped_except_for_marks():
    text = pages.html_page(_page("a < b & `x<y` **bold** p<sub>τ</sub> [table](si3dr.csv) <script>", ("one", "t*w*o")))
    assert "<p>a &lt; b &amp; <code>x&lt;y</code> <strong>bold</strong> p<sub>τ</sub> " in text
    assert '<a href="si3dr.csv">table</a> &lt;script&gt;</p>' in text and "<li>t*w*o</li>" in text
    assert "<h1>Title &amp; &lt;b&gt;</h1>" in text
    _parse(text)


def test_html_holds_its_figures_and_loads_nothing():
    figure = pages.Figure("a.svg", "A caption", 'alt "text"')
    parser = _parse(pages.html_page(_page(figure)))
    sources = [value for _, name, value in parser.attributes if name in ("src", "href", "srcset", "data")]
    assert f"data:image/svg+xml;base64,{base64.b64encode(b'<svg/>').decode()}" in sources
    assert all(value.startswith(("data:", "#")) for value in sources)
    assert ("img", "alt", 'alt "text"') in parser.attributes
    assert '![alt "text"](a.svg)' in pages.markdown(_page(figure))


def test_a_live_page_is_a_file_that_only_html_opens_when_asked(tmp_path):
    page = _page("x", pages.Live("live.html", "Look **here**", b"<p>"))
    pages.write(page, tmp_path)
    assert (tmp_path / "live.html").read_bytes() == b"<p>"
    assert "live" not in (tmp_path / "README.md").read_text() and "\n\n\n" not in (tmp_path / "README.md").read_text()
    parser = _parse(pages.html_page(page))
    assert ("iframe", "title", "Look here") in parser.attributes
    assert [where for where in parser.attributes if where[2] == "live.html"] == [
        ("iframe", "data-src", "live.html"),
        ("a", "href", "live.html"),
    ]


def test_a_star_of_a_name_does_not_end_a_caption():
    figure = pages.Figure("a.svg", "v* as colour, **bold**, v*", "v*")
    assert "\n\n*v\\* as colour, **bold**, v\\**\n" in pages.markdown(_page(figure))
    assert "<figcaption>v* as colour, <strong>bold</strong>, v*</figcaption>" in pages.html_page(_page(figure))


def test_every_section_is_linked():
    text = pages.html_page(_page("x"))
    assert '<a href="#first-part">First part</a>' in text and '<section id="first-part">' in text


def test_a_figure_without_its_file_is_an_error():
    with pytest.raises(KeyError):
        pages.html_page(_page(pages.Figure("missing.svg", "", "")))


def test_style_loads_nothing():
    assert not re.search(r"url\(|@import|https?:", pages.html_page(_page("x")))


@pytest.mark.parametrize(("columns", "widths"), [(8, [8]), (9, [8, 3]), (14, [8, 8]), (15, [8, 8, 3]), (2, [2])])
def test_wide_tables_are_split_and_keep_their_labels(columns, widths):
    header = [f"h{i}" for i in range(columns)]
    rows = [[f"{line}{i}" for i in range(columns)] for line in "ab"]
    parts = pages.split(pages.Table("Words.", [("", columns, False)], header, rows, labels=2))
    assert [len(part.header) for part in parts] == widths
    assert all(part.header[:2] == header[:2] and [r[:2] for r in part.rows] == [r[:2] for r in rows] for part in parts)
    assert [name for part in parts for name in part.header[2:]] == header[2:]
    assert [cell for part in parts for cell in part.rows[1][2:]] == rows[1][2:]
    assert [part.caption for part in parts] == [
        *(f"Part {i} of {len(widths)}." for i in range(1, len(widths))),
        "Words.",
    ]
    assert all(sum(width for _, width, _ in part.groups) == len(part.header) for part in parts)
