"""AC3D: objects in their places, polygons, strips, and files that say more than they hold."""

import re

import numpy as np
import pytest

from ddf.core import checks
from ddf.geometry import mesh_io
from ddf.geometry.formats import ac3d

TRIANGLE = "numvert 3\n0 0 0\n1 0 0\n0 1 0\nnumsurf 1\nSURF 0x10\nmat 0\nrefs 3\n0 0 0\n1 1 0\n2 0 1\n"
HEAD = 'AC3Db\nMATERIAL "a b" rgb 1 0.5 0  amb 1 1 1  emis 0 0 0  spec 0 0 0  shi 10  trans 0.25\nOBJECT world\n'


def _poly(kids=0, extra="", body=TRIANGLE):
    return f"OBJECT poly\n{extra}{body}kids {kids}\n"


def test_one_triangle_with_its_looks():
    looks = 'name "hull"\ntexture "a b.png" base\ntexture "x.png"\ntexrep 2 3\ntexoff 1 0\n'
    text = HEAD + "kids 1\n" + _poly(extra=looks)
    found = ac3d.surfaces(text.encode())
    assert found.materials == (ac3d.Material((1.0, 0.5, 0.0), 0.25),) and found.textures == ("a b.png",)
    assert found.uvs.tolist() == [[1, 0], [3, 0], [1, 3]]
    assert (found.material.tolist(), found.texture.tolist(), found.counts.tolist()) == ([0], [0], [3])
    mesh = mesh_io.parse(text.replace("\n", "\r\n").encode(), ".ac")
    np.testing.assert_array_equal(mesh.triangles, [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]])


def test_kids_move_with_their_parents():
    turn = "rot 0 1 0 -1 0 0 0 0 1\n"  # rows: x -> y, y -> -x
    inner = _poly(extra="loc 1 0 0\n")
    text = HEAD + "kids 2\nOBJECT group\nloc 10 0 0\n" + turn + "kids 1\n" + inner + _poly(extra="loc 0 0 5\n")
    triangles = mesh_io.parse(text.encode(), ".acc").triangles
    np.testing.assert_allclose(triangles[0], [[10, 1, 0], [10, 2, 0], [9, 1, 0]])
    np.testing.assert_allclose(triangles[1], [[0, 0, 5], [1, 0, 5], [0, 1, 5]])


def test_strips_wind_like_their_first_triangle_and_lines_are_none():
    vertices = "numvert 4\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n"
    strip = "SURF 0x14\nmat 0\nrefs 4\n0 0 0\n1 0 0\n2 0 0\n3 0 0\n"
    lines = "SURF 0x21\nmat 0\nrefs 3\n0 0 0\n1 0 0\n2 0 0\nSURF 0x2\nmat 0\nrefs 2\n0 0 0\n3 0 0\n"
    mesh = mesh_io.parse((HEAD + "kids 1\n" + _poly(body=vertices + "numsurf 3\n" + strip + lines)).encode(), ".ac")
    normals, areas = mesh_io.face_normals(mesh)
    assert areas.tolist() == [0.5, 0.5] and normals[:, 2].tolist() == [1, 1]


def test_what_is_not_read_is_passed_over():
    extra = 'name "a\'s"\ndata 12\nOBJECT poly\n\ncrease 45.0\nsubdiv 1\nhidden\nfolded\nurl none\n'
    mesh = mesh_io.parse((HEAD + "kids 1\n" + _poly(extra=extra)).encode(), ".ac")
    assert len(mesh.faces) == 1


def test_objects_that_are_missing_are_said_and_hidden_ones_left_out():
    text = HEAD + "kids 5\n" + _poly(2, 'name "PropFast"\n') + _poly(extra='name "wing"\nloc 0 0 1\n')
    mesh = mesh_io.parse(text.encode(), ".ac")
    assert mesh.remarks == ("5 objects that it counts are not there",) and len(mesh.faces) == 2
    shown = ac3d.surfaces(text.encode(), re.compile("Fast"))
    assert shown.counts.tolist() == [3] and shown.vertices[shown.corners][:, 2].tolist() == [1, 1, 1]


def test_polygons_that_cross_themselves_are_fanned():
    ring = [(0, 0), (4, 0), (4, 4), (1, -1), (0, 4)]
    body = "numvert 5\n" + "".join(f"{x} {y} 0\n" for x, y in ring) + "numsurf 1\nSURF 0\nmat 0\nrefs 5\n"
    body += "".join(f"{i} 0 0\n" for i in range(5))
    mesh = mesh_io.parse((HEAD + "kids 1\n" + _poly(body=body)).encode(), ".ac")
    assert len(mesh.faces) == 3 and mesh.remarks == ("1 polygons cross themselves: cut from their first corner",)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("OBJECT world\n", "must begin with AC3D"),
        (HEAD + "kids 1\nOBJECT poly\nnumvert 3\n0 0 0\n", "cut short at line"),
        (HEAD + "kids 1\n" + _poly().replace("1 0 0", "1 x 0", 1), "line 8: 'x' is not a number"),
        (HEAD + "kids 1\n" + _poly().replace("2 0 1", "3 0 1"), "line 16: vertex 3 of an object that has 3"),
        (HEAD + "kids 1\n" + _poly().replace("0x10", "zz"), "SURF must give its flags"),
        (HEAD + "kids 0\n", "no triangles"),
        (HEAD + "kids 1\n" + _poly().replace("0 1 0", "0 1"), "3 numbers are needed; got 2"),
    ],
)
def test_bad_files_are_one_line(text, said):
    with pytest.raises(checks.InputError, match=said):
        mesh_io.parse(text.encode(), ".ac")
