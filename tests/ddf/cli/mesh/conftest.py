"""A mesh that is no single surface, and how a refusal must look, for the tests of the commands about meshes."""

import pytest
from _shapes import cube, icosphere, joined, moved

from ddf import cli
from ddf.geometry import mesh_io


@pytest.fixture
def soup(tmp_path):
    """Two overlapping parts far from the origin."""
    mesh = moved(joined(moved(cube(), 0.5, (0.4, 0, 0)), moved(icosphere(3), 0.6, (-0.3, 0, 0))), 7.0, (1e4, 0, -1e4))
    path = tmp_path / "soup.ply"
    path.write_bytes(mesh_io.export_bytes(mesh, ".ply"))
    return path


@pytest.fixture
def refuses(soup, tmp_path, capfd):
    """Checks that a command line, with names in braces filled in, ends in code 2, one line and no file."""

    def check(arguments, reason):
        names = {"soup": soup, "none": tmp_path / "none", "folder": tmp_path, "out": tmp_path / "out"}
        assert cli.main([argument.format(**names) for argument in arguments]) == 2
        captured = capfd.readouterr()
        assert captured.err.count("\n") == 1 and reason in captured.err and captured.out == ""
        assert not list(tmp_path.glob("out*"))

    return check
