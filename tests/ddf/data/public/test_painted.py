"""Painted meshes: the surface that `mesh_io` reads, in the colours of their materials and pictures."""

import struct
import zipfile

import _shapes
import numpy as np
import pytest
from _support import damage

from ddf.core import checks
from ddf.data.public import painted, shapes
from ddf.data.synthetic import palette, parts, render
from ddf.data.synthetic.palette import Picture
from ddf.geometry import mesh_io

QUAD = "AC3Db\n{}OBJECT world\nkids 1\nOBJECT poly\n{}numvert 4\n0 0 0\n1 0 0\n1 1 0\n0 1 0\nnumsurf 1\nSURF 0x10\n{}"
REFS = "refs 4\n0 0 0\n1 1 0\n2 1 1\n3 0 1\nkids 0\n"


def _archive(tmp_path, **members):
    path = tmp_path / "kept.zip"
    path.write_bytes(_shapes.zipped({name.replace("_", "/", 1).replace("__", "."): d for name, d in members.items()}))
    return zipfile.ZipFile(path)


def test_obj_keeps_the_surface_and_takes_materials_and_pictures(tmp_path):
    archive = _archive(tmp_path, a_a__obj=_shapes.OBJ, a_a__mtl=_shapes.MTL, a_wood__png=_shapes.png())
    mesh = painted.load(archive, "a/a.obj")
    plain = mesh_io.parse(_shapes.OBJ.encode(), ".obj")
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], plain.triangles)
    assert np.ptp(mesh.colours, axis=0).max() == 0
    np.testing.assert_allclose(mesh.colours[0], painted.WHITE * np.array([1, 0.5, 0]) ** 2.2, rtol=1e-5)
    assert (mesh.picture == 0).all() and mesh.uvs[0].tolist() == [[0, 0], [1, 0], [1, 1]]
    np.testing.assert_allclose(mesh.pictures[0].levels[-1], [[painted.WHITE * np.array([1, 0, 0])]])
    bare = painted.load(_archive(tmp_path, a_a__obj=_shapes.OBJ), "a/a.obj")
    assert len(bare.pictures) == 0 and len(np.unique(bare.colours)) == 1


def test_ac3d_looks_come_from_a_folder_beside_and_invisible_faces_go(tmp_path):
    materials = 'MATERIAL "a" rgb 0 0 1 trans 0\nMATERIAL "b" rgb 0 0 1 trans 1\n'
    faces = f"mat 0\n{REFS}".replace("kids 0\n", "") + f"SURF 0x10\nmat 1\n{REFS}"
    text = QUAD.format(materials, 'texture "C:\\\\own\\\\skin.png"\n', faces).replace("numsurf 1", "numsurf 2")
    archive = _archive(tmp_path, m_p__ac=text, looks_skin__png=_shapes.png((0, 255, 0)))
    mesh = painted.load(archive, "m/p.ac", "looks/")
    assert len(mesh.faces) == 2 and (mesh.picture == 0).all()
    assert mesh.pictures[0].levels[0][0, 0].argmax() == 1
    with pytest.raises(checks.InputError, match=r"m/p.ac: no triangles"):
        painted.load(_archive(tmp_path, m_p__ac=text.replace("mat 0", "mat 1")), "m/p.ac")


def test_damage_names_archive_and_member(tmp_path):
    broken = _shapes.OBJ.replace("f 5 7 8 6", "f 5 7 8 99")
    with pytest.raises(checks.InputError, match=r"kept.zip: a/a.obj: a face uses a vertex"):
        painted.load(_archive(tmp_path, a_a__obj=broken), "a/a.obj")
    archive = _archive(tmp_path, a_a__obj=_shapes.OBJ)
    damage(tmp_path / "kept.zip", 60)
    with pytest.raises(checks.InputError, match=r"kept.zip: a/a.obj: Bad CRC"):
        painted.load(archive, "a/a.obj")


def _volume(mesh):
    return _shapes.area_and_volume(mesh_io.Mesh(mesh.vertices, mesh.faces))[1]


def _md2():
    """A tetrahedron of corners 0, x, y, z at 10 times 0 or 1, of triangles that run clockwise seen from outside."""
    skin, triangles = b".hull".ljust(64, b"\0"), [(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)]
    places = struct.pack("<8h", 0, 0, 8, 0, 0, 4, 8, 4)
    faces = b"".join(struct.pack("<6H", *own, *own) for own in triangles)
    frame = struct.pack("<6f16s", 2, 2, 2, 1, 1, 1, b"first")
    frame += bytes([0, 0, 0, 0, 5, 0, 0, 0, 0, 5, 0, 0, 0, 0, 5, 0])
    at = [68, 68 + 64, 68 + 64 + len(places), 68 + 64 + len(places) + len(faces), 0, 0]
    return struct.pack("<4s16i", b"IDP2", 8, 8, 4, 56, 1, 4, 4, 4, 0, 1, *at) + skin + places + faces + frame


def test_md2_winds_outwards_and_finds_its_skin_by_name(tmp_path):
    mesh = painted.load(_archive(tmp_path, m_a__md2=_md2(), m_hull__png=_shapes.png((0, 255, 0))), "m/a.md2")
    np.testing.assert_allclose(mesh.vertices, np.vstack([np.zeros(3), 10 * np.eye(3)]) + 1)
    assert _volume(mesh) == pytest.approx(1000 / 6)
    assert (mesh.picture == 0).all() and mesh.pictures[0].levels[0][0, 0].argmax() == 1
    uvs = np.array([[0, 1], [1, 1], [0, 0], [1, 0]], dtype=np.float32)  # v up
    np.testing.assert_array_equal(mesh.uvs, uvs[mesh.faces])


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"IDP3" + _md2()[4:], "must begin with IDP2"),
        (_md2()[:-1], "damaged MD2"),
        (_md2().replace(struct.pack("<3H", 1, 3, 2), struct.pack("<3H", 1, 4, 2), 1), "point that is not there"),
    ],
)
def test_a_damaged_md2_gets_one_line(tmp_path, data, said):
    with pytest.raises(checks.InputError, match=f"m/a.md2: .*{said}"):
        painted.load(_archive(tmp_path, m_a__md2=data), "m/a.md2")


def test_turning_keeps_winding_outwards_and_parts_join(tmp_path):
    mesh = painted.load(_archive(tmp_path, a_a__obj=_shapes.OBJ), "a/a.obj")
    assert _volume(mesh.turned(np.diag([1.0, 1.0, -1.0]))) == pytest.approx(_volume(mesh))
    both = mesh.joined([parts.box((5, 5, 5), (1, 1, 1), palette.TYRE)])
    assert _volume(both) == pytest.approx(_volume(mesh) + 1)
    np.testing.assert_allclose(both.colours[-1], palette.TYRE.colour)


def test_pictures_show_where_their_places_are():
    """A square facing the camera: its left half red, its right half blue, upper left corner green."""
    pixels = np.zeros((8, 8, 3), dtype=np.float32)
    pixels[:, :4, 0], pixels[:, 4:, 2] = 1, 1
    pixels[:2, :2] = [0, 1, 0]
    corners = np.array([[0.0, 0, 1], [0, 0, 0], [0, 1, 0], [0, 1, 1]])  # seen from +X: +Z is on the left
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    black = np.zeros((2, 3), dtype=np.float32)
    whole = painted.Painted(corners, faces, black, np.zeros(2, int), uvs[faces], (Picture.of(pixels),))
    light = render.Light(lamps=0.0, key=0.0, sky=1.0, above=0.0, front=0.0, gamma=1.0)
    view = render.Renderer(shapes.shape(whole)).render(render.View(0.0, 0.0, 0.8, light))
    rows, columns = np.nonzero(view[..., 3] == 255)
    top, left, down, across = rows.min(), columns.min(), np.ptp(rows), np.ptp(columns)
    for y, x, channel in ((0.1, 0.1, 1), (0.6, 0.2, 0), (0.6, 0.8, 2)):
        assert view[top + int(y * down), left + int(x * across), :3].argmax() == channel
    covering = shapes.shape(whole).covering
    assert covering is not None and covering.level.tolist() == [0, 0]  # 64 pixels are fewer than those of a view


def test_far_pictures_are_seen_as_their_mean():
    fine = np.indices((256, 256)).sum(axis=0) % 2
    picture = Picture.of(np.repeat(fine[..., None], 3, axis=2).astype(np.float32))
    seen = picture.colours(np.random.default_rng(0).random((100, 2), dtype=np.float32), np.full(100, 3))
    np.testing.assert_allclose(seen, 0.5)
