"""The frame around a stage script: arguments, what is done, notes of time, errors in one line."""

import json
import os
import runpy
from pathlib import Path

import pytest

from ddf.core import notes, storage
from ddf_lab.engine import graph, stage

GIVEN = ("--config", "configs/a.yaml", "--category", "chair")


@pytest.fixture
def called(tmp_path, monkeypatch, capsys):
    """Runs a script with a stage of this body: its code, and the text on stdout and stderr."""
    monkeypatch.chdir(tmp_path)
    for name in ("configs/a.yaml", "b.yaml"):
        storage.write_text(name, "evaluate: {}\nsamples: {}\n")

    def call(body: str, *arguments: str) -> tuple[object, str, str]:
        head = '"""Do it."""\nfrom ddf.core import checks\nfrom ddf_lab.engine import stage\n'
        main = "@stage.main(category=True, seed=True)"
        Path("do_it.py").write_text(f"{head}{main}\ndef make(run):\n    {body}\n")
        monkeypatch.setattr("sys.argv", ["do_it.py", *arguments])
        with pytest.raises(SystemExit) as ended:
            runpy.run_path("do_it.py", run_name="__main__")
        return ended.value.code, *capsys.readouterr()

    return call


@pytest.mark.parametrize(("more", "label", "note"), [((), "", ""), (("--seed", "2"), " seed 2", "-2")])
def test_scripts_pass_arguments_and_note_time_each_seed_its_own(called, more, label, note):
    said = f"configs/a.yaml chair {2 if more else 0}\n"
    assert called("print(run.file, run.category, run.seed)", *GIVEN, *more) == (0, said, f"do_it chair{label}\n")
    folder = Path("artifacts/a/times")
    assert {path.name for path in folder.iterdir()} == {f"do_it-chair{note}.json", f"do_it-chair{note}.lock"}
    assert json.loads((folder / f"do_it-chair{note}.json").read_text())["seconds"] >= 0


def test_a_stage_of_the_graph_is_given_what_it_lists_and_is_done_by_what_it_began_with(called):
    entry = "of: [shape], each: [category], command: x, sections: [samples], inputs: [in.txt], outputs: []"
    storage.write_text("pipeline.yaml", f"do_it: {{{entry}}}\n")
    storage.write_text("stages/do_it.py", "")
    writing = "from pathlib import Path; Path('artifacts/a/in.txt').write_text('changed meanwhile')"
    changing = f"print(list(run.given)); {writing}"
    runs = [called(body, *GIVEN) for body in (changing, "pass", "pass")]
    assert [said for _, said, _ in runs] == ["['samples']\n", "", ""]
    assert [told for _, _, told in runs] == ["do_it chair\n"] * 2 + ["do_it chair: nothing to do\n"]


def test_stage_scripts_end_with_one_line_and_code_2(called):
    assert called("raise checks.InputError('no')", *GIVEN) == (2, "", "do_it chair\ndo_it: error: no\n")
    storage.write_text("artifacts/b/times", "in the way")
    code, _, told = called("pass", "--config", "b.yaml", "--category", "chair")
    assert code == 2 and told.startswith("do_it: error: ") and len(told.splitlines()) == 1


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
    Path("artifacts/a/checksums.json").write_text("half")
    assert stage.checksums(item)(path) == plain(path)
