"""Arguments shared by commands: lists that name what the library has."""

from typing import get_args

from ddf.cli import commands, meshes
from ddf.data import mesh_config
from ddf.fields import framed_field
from ddf.fit import surfaces
from ddf.geometry import mesh_io


def test_lists_and_defaults_are_those_of_the_library():
    """They are written out in the declarations, since importing the library takes long."""
    at = {
        (name, each.name): each.default if each.arg.metavar else each.kind
        for name, command in commands.COMMANDS.items()
        for each in command.parameters
    }
    assert get_args(at["render", "up"]) == framed_field.UP_AXES
    assert get_args(at["surface", "method"]) == surfaces.METHODS
    prepared = mesh_config.MeshesConfig()
    for name in ("faces", "alpha"):
        assert at["mesh", name] == getattr(prepared, name)
    said = meshes.mesh.docstring.arguments
    assert said["source"] == f"mesh to read ({', '.join(mesh_io.READ)})"
    assert said["out"] == f"mesh to write, in the field frame ({', '.join(mesh_io.SUFFIXES)})"
