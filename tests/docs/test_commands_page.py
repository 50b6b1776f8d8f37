"""docs/commands.md is what docs/commands.py writes; the examples of help are well formed."""

import runpy
import shlex
import subprocess
from pathlib import Path

import pytest

from ddf import cli
from ddf.cli import frame

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_the_page_is_current():
    written = runpy.run_path(str(DOCS / "commands.py"))["text"]()
    assert (DOCS / "commands.md").read_text(encoding="utf-8") == written, "run: python docs/commands.py"


@pytest.mark.parametrize("name", frame.COMMANDS)
def test_examples_are_well_formed(name, monkeypatch):
    monkeypatch.setattr("ddf.core.processes.guarded", lambda *_: 0)  # arguments are parsed, nothing runs
    for example in frame.COMMANDS[name].docstring.examples:
        assert example.startswith(f"ddf {name}")
        assert cli.main(shlex.split(example)[1:]) == 0, example


@pytest.mark.parametrize("recipe", sorted((DOCS / "recipes").glob("*.diff")), ids=lambda recipe: recipe.stem)
def test_recipes_apply_to_the_code_as_it_is(recipe):
    subprocess.run(["git", "apply", "--check", recipe], cwd=DOCS.parent, check=True)
