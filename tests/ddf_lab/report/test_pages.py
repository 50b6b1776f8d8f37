"""Pages as Markdown: tables, pictures, escapes."""

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
