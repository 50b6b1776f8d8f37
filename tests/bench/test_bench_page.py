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
