"""How tests call commands, and what they call them on: a mesh in two parts, a torus far off and the field of it."""

import json

import pytest
import yaml
from _shapes import cube, icosphere, joined, moved, torus
from _tiny_fits import SECTION

from ddf import cli
from ddf.fit import fit_folder
from ddf.geometry import mesh_io


@pytest.fixture
def answer(capfd):
    """Calls a command that succeeds: the object that it prints for scripts."""

    def call(*words):
        assert cli.main([*map(str, words), "--json"]) == 0
        return json.loads(capfd.readouterr().out)

    return call


@pytest.fixture
def shown(capfd):
    """Calls a command that succeeds: the lines that it prints for people."""

    def call(*words):
        assert cli.main([*map(str, words)]) == 0
        return capfd.readouterr().out.splitlines()

    return call


@pytest.fixture
def refusal(capfd):
    """Calls a command that refuses, with code 2, nothing on stdout and one line on stderr: that line."""

    def call(*words):
        try:
            code = cli.main([*map(str, words)])
        except SystemExit as stopped:
            code = stopped.code
        said = capfd.readouterr()
        assert (code, said.out, said.err.count("\n")) == (2, "", 1), said.err
        return said.err

    return call


@pytest.fixture(scope="session")
def work(tmp_path_factory):
    """A folder with meshes of two overlapping parts and of a torus, both far from the origin, and settings of a fit."""
    folder = tmp_path_factory.mktemp("fit")
    soup = moved(joined(moved(cube(), 0.5, (0.4, 0, 0)), moved(icosphere(3), 0.6, (-0.3, 0, 0))), 7.0, (1e4, 0, -1e4))
    (folder / "soup.ply").write_bytes(mesh_io.export_bytes(soup, ".ply"))
    mesh = moved(torus(sections=16), 30.0, (100.0, 0.0, -50.0))
    (folder / "torus.ply").write_bytes(mesh_io.ply_bytes(mesh, double=True))
    (folder / "tiny.yaml").write_text(yaml.safe_dump({"fit": SECTION}))
    return folder


@pytest.fixture(scope="session")
def fitted(work):
    """Folder of the field of the torus, and what `ddf fit --json` said."""
    arguments = ["fit", str(work / "torus.ply"), str(work / "field"), "--config", str(work / "tiny.yaml")]
    assert cli.main([*arguments, "--seed", "3"]) == 0
    return work / "field", json.loads((work / "field" / fit_folder.METRICS).read_text())
