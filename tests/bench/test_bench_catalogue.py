"""Benchmarks are found by reading: a new one is a file with a `main`; names, groups and options on the command line."""

import importlib
import inspect

import pytest

from bench import __main__ as program
from bench.lib import catalogue, display, measuring
from ddf.core import checks

KNOWN = catalogue.entries()


@pytest.mark.parametrize("name", KNOWN)
def test_every_benchmark_says_what_it_is_and_what_its_section_shows(name):
    module = importlib.import_module(KNOWN[name].module)
    assert KNOWN[name].about and (module.__doc__ or "").startswith(KNOWN[name].about[:40])
    assert len(inspect.signature(module.main).parameters) <= 1
    assert isinstance(getattr(module, "SECTION", display.Section()), display.Section)


def test_committed_results_are_of_benchmarks_that_are_there():
    committed = {file.stem for file in (measuring.REPORTS / "bench").glob("*.json")}
    assert committed and committed <= KNOWN.keys()


def test_a_file_with_a_main_is_a_benchmark_and_another_is_not(tmp_path):
    for folder in ("fields", "lib"):
        (tmp_path / folder).mkdir()
    text = '"""What it\nmeasures.\n\nHow.\n"""\n\nON_DEMAND = "make fit-proof"\n\n\ndef main():\n    pass\n'
    for name in ("fields/new.py", "lib/no_group.py", "whole.py", "__main__.py"):
        (tmp_path / name).write_text(text)
    (tmp_path / "fields" / "helper.py").write_text('"""Helps."""\n')
    found = catalogue.entries(tmp_path)
    assert list(found) == ["new", "whole"]
    assert found["new"] == catalogue.Entry("new", "fields", "What it measures.", "make fit-proof")
    assert (found["new"].module, found["whole"].module) == ("bench.fields.new", "bench.whole")


def test_names_and_groups_are_chosen_and_without_any_what_make_bench_makes():
    assert [entry.name for entry in catalogue.chosen(["storage", "fits"])] == [
        "storage", *(entry.name for entry in KNOWN.values() if entry.group == "fits")
    ]  # fmt: skip
    default = catalogue.chosen([])
    assert {entry.name for entry in default} == {name for name, entry in KNOWN.items() if not entry.on_demand}
    with pytest.raises(checks.InputError, match="nothing: no such benchmark; there are cloud_sampling, "):
        catalogue.chosen(["nothing"])


@pytest.fixture
def _calls(monkeypatch):
    """What would be run, and where it would write; `storage` fails."""
    calls = []

    class Done:
        def __init__(self, command, env):
            calls.append((command[2:], env.get("DDF_BENCH_OUT")))
            self.returncode = int("storage" in command)

    monkeypatch.delenv("DDF_BENCH_OUT", raising=False)
    monkeypatch.setattr(program.subprocess, "run", Done)
    return calls


def test_several_run_in_processes_of_their_own_then_their_page_and_failures_are_named(_calls, capsys):
    assert program.main(["run", "storage", "evaluation", "--", "--threads", "1"]) == 1
    assert _calls == [
        (["bench", "storage", "--threads", "1"], None),
        (["bench", "evaluation", "--threads", "1"], None),
        (["bench", "page"], None),
    ]
    assert capsys.readouterr().err == "failed: storage\n"
    assert program.main(["run", "fit_options"]) == 0 and _calls[-1] == (["bench", "fit_page"], None)


def test_unknown_names_are_refused_before_anything_runs(_calls):
    for command in ("run", "check"):
        with pytest.raises(checks.InputError, match="nothing: no such benchmark"):
            program.main([command, "evaluation", "nothing"])
    assert _calls == []


def test_check_compares_what_it_measured_with_what_was_there(_calls, tmp_path, monkeypatch):
    seen = []
    monkeypatch.setattr(program, "CHECKED", tmp_path / "new")
    monkeypatch.setattr(program.compare, "run", lambda folders: seen.append(folders) or 0)
    (tmp_path / "new").mkdir()
    assert program.main(["check", "evaluation"]) == 0 and not (tmp_path / "new").exists()
    assert _calls == [(["bench", "evaluation"], str(tmp_path / "new"))]
    assert seen == [[str(measuring.OUT), str(tmp_path / "new")]]
    assert program.main(["check", "storage"]) == 1


def test_bare_program_lists_all(capsys):
    assert program.main([]) == 0
    listed = capsys.readouterr().out
    assert all(f"  {name} " in listed for name in KNOWN) and "[make ablate-options]" in " ".join(listed.split())


def test_a_benchmark_without_options_takes_none(monkeypatch, capsys):
    from bench.data import storage

    monkeypatch.setattr(storage, "main", lambda: calls.append("storage"))
    calls = []
    assert program.main(["storage"]) == 0 and calls == ["storage"]
    with pytest.raises(SystemExit, match="2"):
        program.main(["storage", "--steps", "3"])
    assert calls == ["storage"] and "unrecognized arguments: --steps 3" in capsys.readouterr().err


@pytest.mark.parametrize("room", ["bench", "tests"])
def test_no_folder_is_too_full_and_no_file_too_long(room):
    files = sorted((measuring.ROOT / room).rglob("*.py"))
    for folder in {file.parent for file in files}:
        assert len(list(folder.glob("*.py"))) <= 15, folder
    assert [file for file in files if len(file.read_text(encoding="utf-8").splitlines()) > 400] == []


def test_modules_of_tests_have_names_of_their_own():
    names = [
        file.stem for file in (measuring.ROOT / "tests").rglob("*.py") if file.stem not in ("__init__", "conftest")
    ]
    assert len(names) == len(set(names))
