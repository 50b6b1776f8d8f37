"""What is older than today's code: pages as they are published, benchmarks by their rows."""

import json
from pathlib import Path

import pytest

from bench.lib import measuring
from ddf.core import storage
from ddf_lab.engine import graph, publish, stage
from ddf_lab.run import Run

STAGES = "{{of: [figures], each: [], command: x, sections: [figures], inputs: [{}], outputs: [{}]}}"


@pytest.fixture
def run(tmp_path, monkeypatch):
    """An experiment of two stages, both done."""
    monkeypatch.chdir(tmp_path)
    stages = f"draw: {STAGES.format('', 'draw')}\nshow: {STAGES.format('draw', 'report')}\n"
    storage.write_text(Path("pipeline.yaml"), stages)
    for name in ("draw", "show"):
        storage.write_text(Path(f"stages/{name}.py"), "from ddf.core import seeding\n")
    storage.write_text(Path("configs/own.yaml"), "figures: {}\n")
    for file in ("draw/a.txt", "report/README.md", "report/a.webp"):
        storage.write_text(Path("artifacts/own") / file, f"{file}\n")
    found = Run.read("configs/own.yaml")
    for item in graph.expand(found):
        stage.note(item).write(item.outputs)
    return found


def test_a_page_replaces_the_one_before(run):
    storage.write_text(Path("reports/own/old.svg"), "")
    out = publish.publish(run)
    assert {path.name for path in out.iterdir()} == {"README.md", "a.webp", publish.INPUTS, publish.CODE}
    assert json.loads((out / publish.INPUTS).read_text()) == publish.shipped("field")
    assert {"rabbit", "nested"} <= publish.shipped("field").keys()
    (run.page / "README.md").unlink()
    with pytest.raises(FileNotFoundError, match=r"artifacts/own/report: no page; `ddf run configs/own\.yaml` makes it"):
        publish.publish(run)


@pytest.mark.parametrize(
    ("file", "text", "old"),
    [
        ("stages/draw.py", '"""Words."""\nfrom ddf.core import seeding  # why\n', []),
        ("stages/draw.py", "from ddf.core import notes\n", ["draw"]),
        ("stages/show.py", "X = 1\n", ["show"]),
        ("configs/own.yaml", "figures: {paper_candidates: true}\n", ["draw", "show"]),
        ("artifacts/own/draw/a.txt", "other\n", ["draw", "show"]),
    ],
)
def test_what_changed_before_stands_in_the_first_line_and_what_changes_later_is_listed(run, file, text, old):
    made_of = not file.startswith("artifacts")
    publish.publish(run)
    assert publish.listed() == []
    storage.write_text(Path(file), text)
    assert publish.listed() == ([f"reports/own: {', '.join(old)}"] if old and made_of else [])
    assert Path("reports/own/README.md").read_text().startswith(publish.STALE) == bool(old and made_of)
    out = publish.publish(Run.read("configs/own.yaml"))
    first, *rest = (out / "README.md").read_text().splitlines()
    assert first == (f"Stale, of older code or settings: {', '.join(old)}." if old else "report/README.md")
    assert rest[-1:] == (["report/README.md"] if old else [])
    assert publish.listed() == ([f"reports/own: {', '.join(old)}"] if old else [])  # told until it is made anew


def test_rows_of_a_benchmark_are_held_against_its_code_and_what_it_imports_of_bench(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    files = {"bench/fields/own.py": "from bench.lib import near\n", "bench/lib/near.py": "from bench.lib import far\n"}
    for name, text in {**files, "bench/lib/far.py": "X = 1\n", "bench/lib/other.py": "X = 1\n"}.items():
        storage.write_text(Path(name), text)
    code = publish.of_bench(Path("bench/fields/own.py").absolute())
    rows = [{"what": "a", "code": code}, {"what": "b"}]
    storage.write_json(Path("reports/bench/own.json"), {"rows": rows})
    assert publish.listed() == ["reports/bench/own.json: 1 of 2 rows"]
    storage.write_text(Path("bench/lib/other.py"), "X = 2\n")
    assert publish.of_bench(Path("bench/fields/own.py")) == code
    storage.write_text(Path("bench/lib/far.py"), "X = 2\n")
    assert publish.listed() == ["reports/bench/own.json: 2 of 2 rows"]


def test_rows_that_are_measured_keep_their_code(tmp_path, monkeypatch):
    monkeypatch.setattr(measuring, "OUT", tmp_path)
    measuring.write("own", 1, [measuring.row("a", {}, [1.0], {"x": 1.0, "gain": 3.0})], code="first")
    measuring.write("own", 1, [measuring.row("b", {}, [1.0], {})], kept=True, code="second")
    measuring.write("own", 1, [measuring.row("a", {}, [1.0], {"x": 2.0})], kept=True, code="third")
    rows = json.loads((tmp_path / "own.json").read_text())["rows"]
    assert [(row["what"], row["code"]) for row in rows] == [("b", "second"), ("a", "third")]
    assert rows[1]["error"] == {"x": 2.0, "gain": 3.0}
