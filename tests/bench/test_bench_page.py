"""How benchmarks take seconds, and their page: lines, and which of them."""

import pytest

from bench.lib import measuring, page
from ddf_lab.report import pages


@pytest.fixture(autouse=True)
def _out(tmp_path, monkeypatch):
    monkeypatch.setattr(measuring, "OUT", tmp_path)


def test_page_has_a_line_per_row_as_it_was_written(tmp_path):
    made = [measuring.row(f"way {i}", {"hidden": 8, "n": i}, [1e-2 * 2**i], {"off": 10.0**-i}) for i in range(2)]
    measuring.write("ray_casting", 2, made)
    text = pages.markdown(page.page(tmp_path))
    assert text.count("| way ") == 2 and "| way 1 | 1 | 20 | 0.1 |" in text and "*hidden 8. 2 of 2 lines" in text
    assert "threads: 2; " in text and "Stale, of older code: 2 of 2 lines." in text
    assert all(name in text for name in measuring.PACKAGES)


def test_samples_are_means_of_calls_taken_in_turn():
    """By a clock that the candidates move: the second call says how many make a sample."""
    now, order, lengths = [0.0], [], {"slow": [1.0] * 9, "fast": [measuring.TICK / 1.5] * 9}

    def call(name):
        order.append(name)
        now.append(lengths[name].pop())

    times = measuring.interleaved({name: lambda name=name: call(name) for name in lengths}, 3, lambda: sum(now))
    assert times == {"slow": pytest.approx([1.0] * 3), "fast": pytest.approx([measuring.TICK / 1.5] * 3)}
    assert order == ["slow"] * 2 + ["fast"] * 2 + ["slow", "fast", "fast"] * 3
