"""Arguments shared by commands: lists that name what the library has, and checks before any work."""

import argparse
from typing import get_args

import pytest

from ddf.cli import arguments, commands, meshes
from ddf.data import mesh_config
from ddf.fields import framed_field, stored_fields
from ddf.fit import surfaces
from ddf.geometry import mesh_io
from ddf.io import onnx_file


def test_lists_and_defaults_are_those_of_the_library():
    """They are written out in the declarations, since importing the library takes long."""
    at = {
        (name, each.name): each.default if each.arg.metavar else each.kind
        for name, command in commands.COMMANDS.items()
        for each in command.parameters
    }
    assert get_args(at["render", "up"]) == framed_field.UP_AXES
    assert get_args(at["export", "precision"]) == (onnx_file.FULL, *onnx_file.PRECISIONS)
    assert get_args(at["surface", "method"]) == surfaces.METHODS
    assert at["points", "cycles"] == stored_fields.CLOUD["cycles"]
    assert at["points", "directions"] == stored_fields.CLOUD["num_directions"]
    prepared = mesh_config.MeshesConfig()
    for name in ("faces", "alpha", "offset"):
        assert at["mesh", name] == getattr(prepared, name)
    said = meshes.mesh.docstring.arguments
    assert said["source"] == f"mesh to read ({', '.join(mesh_io.READ)})"
    assert said["out"] == f"mesh to write, in the field frame ({', '.join(mesh_io.SUFFIXES)})"


@pytest.mark.parametrize("text", ["x", "1.5", "0", "11", ""])
def test_whole_numbers_keep_to_their_range(text):
    with pytest.raises(argparse.ArgumentTypeError, match=f"must be a whole number, 1 to 10; got '{text}'"):
        arguments.whole_number(1, 10)(text)


def test_whole_numbers_may_have_no_end():
    assert arguments.whole_number(0)("123456789") == 123456789
    with pytest.raises(argparse.ArgumentTypeError, match="must be a whole number, 0 or more; got '-1'"):
        arguments.whole_number(0)("-1")


def test_outputs_are_a_list_with_commas():
    assert arguments.outputs(" depth, normals,") == ("depth", "normals")
    with pytest.raises(argparse.ArgumentTypeError, match=r"must be among visibility, .*; got colour"):
        arguments.outputs("depth,colour")
    with pytest.raises(argparse.ArgumentTypeError, match="got none"):
        arguments.outputs(",")
