"""The page of the benchmarks: lines, and which of them."""

import pytest

from bench.lib import measuring, page
from ddf_lab.report import pages


@pytest.fixture(autouse=True)
def _out(tmp_path, monkeypatch):
    monkeypatch.setattr(measuring, "OUT", tmp_path)


def _rows(count, what="way {}"):
    for i in range(count):
        yield measuring.row(what.format(i), {"hidden": 8, "n": i}, [1e-2 * 2**i], {"off": 10.0**-i})


def test_page_has_a_line_per_row_as_it_was_written(tmp_path):
    measuring.write("ray_casting", 2, _rows(2))
    text = pages.markdown(page.page(tmp_path))
    assert text.count("| way ") == 2 and "| way 1 | 1 | 20 | 0.1 |" in text and "*hidden 8. 2 of 2 lines" in text
    assert "threads: 2" in text and all(name in text for name in measuring.PACKAGES)


def test_page_of_many_rows_shows_the_first_or_those_that_its_module_names(tmp_path):
    measuring.write("ray_casting", 1, _rows(page.MOST_ROWS + 5))
    assert pages.markdown(page.page(tmp_path)).count("| way ") == page.MOST_ROWS
    measuring.write("fits", 1, [*_rows(3, "sine, 60 s"), *_rows(page.MOST_ROWS)])
    text = pages.markdown(page.page(tmp_path))
    assert text.count("| sine, 60 s |") == 3 and f"3 of {page.MOST_ROWS + 3} lines; all: [fits.json]" in text
