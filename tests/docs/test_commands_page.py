"""docs/commands.md has a section for every command; the examples of help are well formed."""

import re
import shlex
from pathlib import Path

import pytest

from ddf import cli
from ddf.cli import commands

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "commands.md").read_text()
MODULES = {name: entry.load() for name, entry in commands.COMMANDS.items()}


def test_every_command_has_a_section_and_nothing_else_has():
    assert set(re.findall(r"(?m)^### ddf (\w+)$", PAGE)) == set(MODULES)


@pytest.mark.parametrize("name", commands.COMMANDS)
def test_examples_are_well_formed(name, monkeypatch):
    monkeypatch.setattr("ddf.core.errors.guarded", lambda *_: 0)  # arguments are parsed, nothing runs
    for example in MODULES[name].EXAMPLES:
        assert example.startswith(f"ddf {name}")
        assert cli.main(shlex.split(example)[1:]) == 0, example
