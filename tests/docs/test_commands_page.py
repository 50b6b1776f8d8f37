"""docs/commands.md has a section for every command, with an example of its help; the examples are well formed."""

import importlib
import re
import shlex
from pathlib import Path

import pytest

from ddf import cli
from ddf.cli import commands

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "commands.md").read_text()
MODULES = {name: importlib.import_module(entry.module) for name, entry in commands.COMMANDS.items()}


@pytest.mark.parametrize("name", commands.COMMANDS)
def test_every_command_has_a_section_with_an_example_of_its_help(name):
    (section,) = re.findall(rf"(?ms)^### ddf {name}\n(.*?)(?=^##|\Z)", PAGE)
    assert any(f"```sh\n{example}\n```" in section for example in MODULES[name].EXAMPLES)
    assert len(section.split("```")[0].strip()) > 40, "the section says what the command does"


def test_there_are_no_other_sections():
    assert set(re.findall(r"(?m)^### ddf (\w+)$", PAGE)) == set(commands.COMMANDS)


@pytest.mark.parametrize("name", commands.COMMANDS)
def test_examples_are_well_formed(name, monkeypatch):
    monkeypatch.setattr("ddf.core.guard.guarded", lambda *_: 0)  # arguments are parsed, nothing runs
    for example in MODULES[name].EXAMPLES:
        assert example.startswith(f"ddf {name}")
        assert cli.main(shlex.split(example)[1:]) == 0, example
