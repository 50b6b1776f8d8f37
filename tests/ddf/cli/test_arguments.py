"""Arguments shared by commands: lists that name what the library has, and what is refused before any work."""

import subprocess
import sys
from typing import get_args

import pytest
from _shapes import cube

from ddf import cli
from ddf.cli import frame
from ddf.data import mesh_config
from ddf.fields import framed_field
from ddf.fit import surfaces


def test_lists_and_defaults_are_those_of_the_library():
    """They are written out in the declarations, since importing the library takes long."""
    at = {
        (name, each.name): each.default if each.arg.metavar else each.kind
        for name, command in frame.COMMANDS.items()
        for each in command.parameters
    }
    assert get_args(at["render", "up"]) == framed_field.UP_AXES
    assert get_args(at["surface", "method"]) == surfaces.METHODS
    prepared = mesh_config.MeshesConfig()
    for name in ("faces", "alpha"):
        assert at["mesh", name] == getattr(prepared, name)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("query cube.obj --rays rays.npz --out out.npz", "cube.obj: this is a mesh; make a field of it first: ddf fit"),
        ("render rabbit /proc/picture.png", "/proc/picture.png: no file can be written in /proc (No such file"),
        ("fit cube.obj /proc/self/field", "/proc/self/field: no file can be written in /proc/"),
    ],
)
def test_what_cannot_be_done_is_told_before_any_work(words, told, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    cube().save("cube.obj")
    monkeypatch.setattr("ddf.cli.declare.Command.call", lambda *_: pytest.fail("work was begun"))
    assert cli.main(words.split()) == 2
    assert told in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["cube.obj"]


def test_python_runs_the_package_as_the_command():
    said = subprocess.run([sys.executable, "-m", "ddf", "--version"], capture_output=True, text=True, check=True).stdout
    assert said.startswith("ddf ")
