"""Benchmarks are found by reading: a new one is a file with a `main`; names and options on the command line."""

import importlib
import types

import pytest

from bench import __main__ as program
from bench.lib import catalogue, measuring
from ddf.cli import declare
from ddf.core import checks

KNOWN = catalogue.entries()


@pytest.mark.parametrize("name", KNOWN)
def test_every_benchmark_says_what_it_is_and_what_its_section_shows(name):
    module = importlib.import_module(KNOWN[name].module)
    options = declare.Command(module.main, name, room="")
    assert KNOWN[name].about and {each.name for each in options.parameters} <= options.docstring.arguments.keys()


def test_committed_results_are_of_benchmarks_that_are_there():
    committed = {file.stem for file in (measuring.REPORTS / "bench").glob("*.json")}
    assert committed and committed <= KNOWN.keys()


def test_a_file_with_a_main_is_a_benchmark_and_another_is_not(tmp_path):
    text = '"""What it\nmeasures.\n\nHow.\n"""\n\n\ndef main():\n    pass\n'
    (tmp_path / "fields").mkdir()
    for name in ("fields/new.py", "__main__.py"):
        (tmp_path / name).write_text(text)
    (tmp_path / "fields" / "helper.py").write_text('"""Helps."""\n')
    new = catalogue.Entry("new", "bench.fields.new", tmp_path / "fields" / "new.py", ("What it measures.", "How."))
    assert catalogue.entries(tmp_path) == {"new": new}


def test_several_run_in_processes_of_their_own_then_their_page_and_failures_are_named(monkeypatch, capsys):
    calls = []

    def run(command):
        calls.append(command[3])
        return types.SimpleNamespace(returncode=int("ray_casting" in command))

    monkeypatch.setattr(program.subprocess, "run", run)
    assert program.main(["run", "ray_casting", "pose"]) == 1
    assert calls == ["ray_casting", "pose", "page"] and capsys.readouterr().err == "failed: ray_casting\n"
    with pytest.raises(checks.InputError, match="nothing: no such benchmark; there are complete, fits, "):
        program.main(["run", "pose", "nothing"])
    assert program.main(["run"]) == 0
    listed = capsys.readouterr().out
    assert all(f"  {name} " in listed for name in KNOWN)
