"""A torus far from the origin and the tiny field fitted to it, shared by the tests of the commands about fields."""

import json

import pytest
import yaml
from _shapes import moved, torus
from _tiny_fits import SECTION

from ddf import cli
from ddf.fit import fitting
from ddf.geometry import mesh_io


@pytest.fixture(scope="session")
def work(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fit")
    mesh = moved(torus(sections=16), 30.0, (100.0, 0.0, -50.0))
    (folder / "torus.ply").write_bytes(mesh_io.ply_bytes(mesh, double=True))
    (folder / "tiny.yaml").write_text(yaml.safe_dump({"fit": SECTION}))
    return folder


@pytest.fixture(scope="session")
def fitted(work):
    """Folder of a field, and what `ddf fit --json` said."""
    arguments = ["fit", str(work / "torus.ply"), str(work / "field"), "--config", str(work / "tiny.yaml")]
    assert cli.main([*arguments, "--seed", "3"]) == 0
    return work / "field", json.loads((work / "field" / fitting.METRICS).read_text())
