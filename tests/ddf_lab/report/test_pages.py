"""Pages as Markdown: tables, pictures, escapes."""

import pytest

from ddf_lab.report import pages


def test_a_page_has_its_tables_bullets_and_pictures(tmp_path):
    table = pages.Table("A caption", ["", "b"], [["a|b", pages.Cell("1.0", best=True)], ["two", "5"]])
    figure = pages.Figure("a.svg", "v* as colour, **bold**, v*", "v* and `code`", b"<svg/>")
    pages.write(pages.Page("Title", ["Lead"], [pages.Section("First", [table, ("one", "two"), figure])]), tmp_path)
    assert (tmp_path / "README.md").read_text() == (
        "# Title\n\nLead\n\n## First\n\n|  | b |\n| :-- | --: |\n| a\\|b | **1.0** |\n| two | 5 |\n\n*A caption*\n\n"
        "- one\n- two\n\n![v and code](a.svg)\n\n*v\\* as colour, **bold**, v\\**\n"
    )
    assert (tmp_path / "a.svg").read_bytes() == b"<svg/>"


@pytest.mark.parametrize(("columns", "widths"), [(8, [8]), (9, [8, 3]), (14, [8, 8]), (15, [8, 8, 3]), (2, [2])])
def test_wide_tables_are_split_and_keep_their_labels(columns, widths):
    header = [f"h{i}" for i in range(columns)]
    rows = [[f"{line}{i}" for i in range(columns)] for line in "ab"]
    parts = pages.split(pages.Table("Words.", header, rows, labels=2))
    assert [len(part.header) for part in parts] == widths
    assert all([*part.header[:2]] == ["h0", "h1"] and part.rows[1][1] == "b1" for part in parts)
    assert [cell for part in parts for cell in part.rows[0][2:]] == rows[0][2:]
    assert parts[-1].caption == "Words."
