"""The frame around a stage script: arguments, what is done, notes of time, errors in one line."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from ddf.core import notes, storage
from ddf_lab import run
from ddf_lab.engine import graph, stage

ROOT = Path(__file__).resolve().parents[3]


def _stage(tmp_path: Path, body: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    script = tmp_path / "do_it.py"
    head = '"""Do it."""\nfrom ddf.core import checks\nfrom ddf_lab.engine import stage\n'
    main = "@stage.main(category=True, seed=True)"
    script.write_text(f"{head}{main}\ndef make(run):\n    {body}\n")
    for name in ("configs/a.yaml", "b.yaml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("evaluate: {}\nsamples: {}\n")
    command = [sys.executable, str(script), *arguments]
    variables = {**os.environ, "PYTHONPATH": str(ROOT / "src"), **environment}
    return subprocess.run(command, cwd=tmp_path, env=variables, capture_output=True, text=True)


GIVEN = ("--config", "configs/a.yaml", "--category", "chair")


@pytest.mark.parametrize(("more", "label", "note"), [((), "", ""), (("--seed", "2"), " seed 2", "-2")])
def test_scripts_pass_arguments_and_note_time_each_seed_its_own(tmp_path, more, label, note):
    result = _stage(tmp_path, "print(run.file, run.category, run.seed)", *GIVEN, *more)
    said = f"configs/a.yaml chair {2 if more else 0}\n"
    assert (result.returncode, result.stdout, result.stderr) == (0, said, f"do_it chair{label}\n")
    folder = tmp_path / "artifacts/a/times"
    assert {path.name for path in folder.iterdir()} == {f"do_it-chair{note}.json", f"do_it-chair{note}.lock"}
    times = json.loads((folder / f"do_it-chair{note}.json").read_text())
    assert times["seconds"] >= 0


def test_a_stage_of_the_graph_is_given_what_it_lists_and_is_done_by_what_it_began_with(tmp_path):
    entry = "of: [shape], each: [category], command: x, sections: [samples], inputs: [in.txt], outputs: []"
    (tmp_path / "pipeline.yaml").write_text(f"do_it: {{{entry}}}\n")
    (tmp_path / "stages").mkdir()
    (tmp_path / "stages" / "do_it.py").touch()
    changing = "print(list(run.given)); open('artifacts/a/in.txt', 'w').write('changed meanwhile')"
    runs = [_stage(tmp_path, body, *GIVEN) for body in (changing, "pass", "pass")]
    assert [run.stdout for run in runs] == ["['samples']\n", "", ""]
    assert [run.stderr for run in runs] == ["do_it chair\n"] * 2 + ["do_it chair: nothing to do\n"]


def test_stage_scripts_end_with_one_line_and_code_2(tmp_path):
    result = _stage(tmp_path, "raise checks.InputError('no')", *GIVEN)
    assert (result.returncode, result.stderr) == (2, "do_it chair\ndo_it: error: no\n")
    (tmp_path / "artifacts" / "b").mkdir(parents=True)
    (tmp_path / "artifacts" / "b" / "times").write_text("in the way")
    result = _stage(tmp_path, "pass", "--config", "b.yaml", "--category", "chair")
    assert result.returncode == 2
    assert result.stderr.startswith("do_it: error: ") and len(result.stderr.splitlines()) == 1
    result = _stage(tmp_path, "pass", *GIVEN, "--seed", "-1")
    assert result.returncode == 2
    assert result.stderr.splitlines()[-1].endswith("argument --seed: must be a whole number, 0 or more; got '-1'")


CONFIG = "evaluate: {oracle_points: 250, oracle_shortlist: 2}\n"


@pytest.fixture
def item(tmp_path, monkeypatch):
    """A stage with a script that imports one module, one input and one folder of outputs; already run."""
    monkeypatch.chdir(tmp_path)
    files = {
        "stages/count.py": '"""Count."""\nfrom ddf.core import seeding\nfrom ddf_lab.engine import stage\n',
        "a.yaml": CONFIG,
        "artifacts/a/in.txt": "1",
        "artifacts/a/out/b.txt": "2",
    }
    for name, text in files.items():
        storage.write_text(name, text)
    entry = graph.Stage(("shape",), (), "", ("evaluate",), ("in.txt",), ("out",))
    made = graph.Item("count", entry, Path("a.yaml"))
    stage.note(made).write(made.outputs)
    return made


def test_what_changed_nothing_that_counts_is_done(item):
    assert stage.note(item).fits()
    Path("stages/count.py").write_text(
        '"""Other words."""\nfrom ddf.core import seeding  # why\nfrom ddf_lab.engine import stage\n'
    )
    Path("a.yaml").write_text(f"# a remark\n{CONFIG}dataset: {{}}\n")
    assert stage.note(item).fits()


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("artifacts/a/in.txt", "2"),
        ("artifacts/a/in.txt", None),
        ("artifacts/a/out/b.txt", "3"),
        ("artifacts/a/out/b.txt", None),
        ("artifacts/a/out/c.txt", ""),
        ("a.yaml", CONFIG.replace("250", "251")),
        ("stages/count.py", "from ddf.core import seeding\nX = 1\n"),
        ("stages/count.py", "from ddf.core import notes, seeding\n"),
    ],
)
def test_whatever_it_uses_or_made_counts(item, name, text):
    if text is None:
        Path(name).unlink()
    else:
        Path(name).write_text(text)
    assert not stage.note(item).fits()


def test_the_frame_of_stages_does_not_count(item, monkeypatch):
    first = stage.note(item).fingerprint
    monkeypatch.setattr(stage, "FRAME", "nothing")
    assert stage.note(item).fingerprint != first


def test_a_script_that_is_no_stage_of_the_graph_has_no_item(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert graph.find("report", run.Run(Path("a.yaml"), {})) is None  # no graph here


def test_checksums_are_kept_while_a_file_is_as_it_was_and_read_anew_otherwise(item, monkeypatch):
    path, reads = Path("artifacts/a/out/b.txt"), []
    monkeypatch.setattr(notes.Checksums, "YOUNG", -1)
    plain = storage.checksum
    known = stage.checksums(item)
    assert known("artifacts/a/out") == plain("artifacts/a/out")
    known.write()
    monkeypatch.setattr(storage, "checksum", lambda *given: reads.append(given[0]) or plain(*given))
    assert stage.checksums(item)(path) == plain(path) and reads == [path]  # the call itself: no file was read
    before = path.stat()
    path.write_text("3")
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))  # as if nothing had happened
    assert stage.checksums(item)(path) == plain(path) and stage.note(item, stage.checksums(item)).fits() is False
    monkeypatch.setattr(notes.Checksums, "YOUNG", 10**15)
    path.write_text("4")
    fresh = stage.checksums(item)
    assert fresh(path) == plain(path)
    fresh.write()
    assert "4" not in json.loads(Path("artifacts/a/checksums.json").read_text())  # too young to be kept
    Path("artifacts/a/checksums.json").write_text("half")
    assert stage.checksums(item)(path) == plain(path)
