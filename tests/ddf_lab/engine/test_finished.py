"""A stage is done while what it uses and what it made are as it left them."""

from pathlib import Path

import pytest

from ddf_lab.engine import finished, graph
from ddf_lab.run import Run

CONFIG = "evaluate: {oracle_points: 250, oracle_shortlist: 2}\n"


@pytest.fixture
def item(tmp_path, monkeypatch):
    """A stage with a script that imports one module, one input and one folder of outputs; already run."""
    monkeypatch.chdir(tmp_path)
    files = {
        "stages/count.py": '"""Count."""\nfrom ddf.core import seeding\nfrom ddf_lab.engine import stage\n',
        "a.yaml": CONFIG,
        "in.txt": "1",
        "out/b.txt": "2",
    }
    for name, text in files.items():
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_text(text)
    return graph.Item(
        "count", "a", "", {"a.yaml": ("evaluate",)}, ("in.txt", "stages/count.py", "src/ddf/core"), ("out",)
    )


def test_nothing_changed_is_done(item):
    finished.note(item).write(item.outs)
    assert finished.note(item).fits()
    Path("stages/count.py").write_text(
        '"""Other words."""\nfrom ddf.core import seeding  # why\nfrom ddf_lab.engine import stage\n'
    )
    Path("a.yaml").write_text(f"# a remark\n{CONFIG}dataset: {{}}\n")
    assert finished.note(item).fits()


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("in.txt", "2"),
        ("out/b.txt", "3"),
        ("out/c.txt", ""),
        ("a.yaml", CONFIG.replace("250", "251")),
        ("stages/count.py", "from ddf.core import seeding\nX = 1\n"),
        ("stages/count.py", "from ddf.core import notes, seeding\n"),
    ],
)
def test_whatever_it_uses_or_made_counts(item, name, text):
    finished.note(item).write(item.outs)
    Path(name).write_text(text)
    assert not finished.note(item).fits()


@pytest.mark.parametrize("name", ["in.txt", "out/b.txt"])
def test_what_is_missing_is_not_done(item, name):
    finished.note(item).write(item.outs)
    Path(name).unlink()
    assert not finished.note(item).fits()


def test_the_frame_of_stages_does_not_count(item, monkeypatch):
    first = finished.note(item).fingerprint
    monkeypatch.setattr(finished, "FRAME", "nothing")
    assert finished.note(item).fingerprint != first


def test_a_script_that_is_no_stage_of_the_graph_has_no_item(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert finished.find("report", Run(Path("a.yaml"), {})) is None  # no graph here
