"""Files as people have them: each reader against the right values, in encodings and variants, made here and kept."""

import json
import resource
import struct

import numpy as np
import pytest
import trimesh
from _shapes import QUADS, UNIT_CUBE, area_and_volume, icosphere
from hypothesis import given, settings
from hypothesis import strategies as st

from ddf.core import checks
from ddf.geometry import mesh_io

OBJ = "".join(f"v {x} {y} {z}\n" for x, y, z in UNIT_CUBE)
OBJ += "".join("f " + " ".join(str(i + 1) for i in q) + "\n" for q in QUADS)
ROWS = "".join(f"{x} {y} {z}\n" for x, y, z in UNIT_CUBE) + "".join(f"4 {a} {b} {c} {d}\n" for a, b, c, d in QUADS)
OFF = "8 6 0\n" + ROWS
PLY = (
    "ply\nformat ascii 1.0\ncomment after this no end_header\nelement vertex 8\nproperty float x\nproperty float y\n"
    "property float z\nelement face 6\nproperty list uchar int vertex_indices\nend_header\n" + ROWS
)


def _stl(mesh):
    rows = ("".join(f"  vertex {x} {y} {z}\n" for x, y, z in triangle) for triangle in mesh.triangles.tolist())
    facets = "".join(f"facet normal 0 0 0\n outer loop\n{row} endloop\nendfacet\n" for row in rows)
    return f"solid a vertex\n{facets}endsolid a vertex\n"


BACKWARDS = "".join("f " + " ".join(f"{i - 8}//-1" for i in q) + "\n" for q in QUADS)
CUBE = mesh_io.parse(OBJ.encode(), ".obj")
STL = _stl(CUBE)
BINARY_STL = b"solid facet endsolid".ljust(80) + mesh_io.export_bytes(CUBE, ".stl")[80:]


GOOD = {
    "bom.obj": b"\xef\xbb\xbf" + OBJ.encode(),
    "bom.off": b"\xef\xbb\xbfOFF\n" + OFF.encode(),
    "bom.ply": b"\xef\xbb\xbf" + PLY.encode(),
    "bom.stl": b"\xef\xbb\xbf" + STL.encode(),
    "utf16.obj": OBJ.encode("utf-16"),
    "utf16be.obj": b"\xfe\xff" + OBJ.encode("utf-16-be"),
    "utf32.obj": OBJ.encode("utf-32"),
    "cr.obj": OBJ.replace("\n", "\r").encode(),
    "cr.off": ("OFF\n" + OFF).replace("\n", "\r").encode(),
    "cr.ply": PLY.replace("\n", "\r").encode(),
    "crlf.ply": PLY.replace("\n", "\r\n").encode(),
    "cr.stl": STL.replace("\n", "\r").encode(),
    "backslash.obj": ("# path c:\\temp\\\n" + OBJ.replace("f ", "# again \\\nf ", 1)).encode(),
    "continued.obj": OBJ.replace("f 1 4", "f 1 \\\n 4").encode(),
    "inline.obj": OBJ.replace("v 0 0 0\n", "v 0 0 0 # first \\\n").encode(),
    "groups.obj": ("mtllib a.mtl\no box\ng a b\ns 1\nusemtl #red\n" + OBJ + "l 1 2 3\np 1\n").encode(),
    "colours.obj": OBJ.replace("v 0 0 0\n", "v 0 0 0 1 0.5 0\n").encode(),
    "latin.obj": b"g \xe9\xe8\n" + OBJ.encode(),
    "capitals.obj": OBJ.upper().encode(),
    "negative.obj": (OBJ.split("f ")[0] + BACKWARDS).encode(),
    "glued.off": b"OFF" + OFF.encode(),
    "small.off": b"off\n" + OFF.encode(),
    "one_line.off": b"OFF " + OFF.encode(),
    "comments.off": ("OFF # made by\n\n# counts\n" + OFF.replace("0 0 0\n", "0 0 0 # origin\n\n", 1)).encode(),
    "colours.off": ("COFF\n" + OFF.replace("\n4 ", " 255 0 0 255\n4 ", 1)).encode(),
    "no_edges.off": ("OFF\n" + OFF.replace("8 6 0", "8 6")).encode(),
    "mixed.off": ("OFF\n" + OFF.replace("8 6 0", "8 7 0").replace("4 0 3 2 1\n", "3 0 3 2\n3 0 2 1\n")).encode(),
    "blank.ply": PLY.replace("0 0 0\n", "0 0 0\n\n", 1).encode(),
    "solid.stl": BINARY_STL,
    "capitals.stl": STL.upper().encode(),
    "indented.stl": b"\n  " + STL.encode(),
    "two.stl": (STL.split("endsolid")[0] + "endsolid\nsolid b\nendsolid b\n").encode(),
}


@pytest.mark.parametrize("name", GOOD)
def test_unit_cube_is_read_whatever_the_file_looks_like(name):
    mesh = mesh_io.parse(GOOD[name], "." + name.split(".")[1])
    assert len(mesh.faces) == 12 and mesh.remarks == ()
    assert area_and_volume(mesh) == pytest.approx((6.0, 1.0))


HUGE_PLY = PLY.replace("ascii", "binary_little_endian").replace("vertex 8", "vertex 9999999999")
REFUSED = {
    "empty.obj": (b"", "empty"),
    "blank.stl": (b"\0" * 100, "empty"),
    "pointer.stl": (b"version https://git-lfs.github.com/spec/v1\n", r"pointer\.stl: a Git LFS pointer"),
    "text.obj": (b"hello\nworld\n", "no triangles"),
    "range.obj": (b"v 0 0 0\nf 1 2 3\n", "uses vertex 3"),
    "huge.off": (b"OFF\n99999999999 1 0\n0 0 0\n", "claims 99999999999 vertices"),
    "faces.off": (b"OFF\n1 99999999999 0\n0 0 0\n", "claims 99999999999 faces"),
    "header.off": (b"NOFF\n", "no OFF header"),
    "huge.stl": (b"x" * 80 + struct.pack("<I", 4_000_000_000), "claims 4000000000 triangles"),
    "huge.ply": (HUGE_PLY.encode(), "claims 9999999999 vertex"),
    "header.ply": (b"ply\nformat", "no ply header"),
    "solid.ply": (b"solid\nend_header\n", "not a PLY file"),
    "form.ply": (PLY.replace("ascii", "middle_endian").encode(), "ascii or binary"),
    "few.ply": ((PLY.split("element face")[0] + "end_header\n" + 7 * "1.25 1.5 0\n").encode(), "claims 8 vertex"),
    "nan.ply": (PLY.replace("0 0 0\n", "0 nan 0\n", 1).encode(), "finite"),
    "vertices.ply": (b"ply\nformat ascii 1.0\nelement face 1\nend_header\n", "must have an 'element vertex"),
    "axes.ply": (PLY.replace("property float y\n", "").encode(), "must have x, y and z"),
    "list.ply": (PLY.replace("float x", "list uchar int x").encode(), "plain number"),
    "noise.glb": (b"\x01\x02" * 40, "no glTF header"),
    "json.glb": (struct.pack("<4sIIII", b"glTF", 2, 24, 4, 0x4E4F534A) + b"{{{{", "JSON chunk"),
    "mesh.xyz": (b"0 0 0", "must end in"),
    "extra.off": (b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 1 2\n", "line 7: rows follow"),
    "binary.off": (b"OFF BINARY\n" + bytes(40) + b"x", "zero byte|binary OFF"),
    "four.off": (b"4OFF\n" + OFF.encode(), "four or n"),
    "short_face.off": (b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "line 6: the row of face 0 is too short"),
    "fake_utf16.obj": (b"\xff\xfe" + OBJ.encode() + b"x", "UTF-16"),
    "octets.obj": (OBJ.encode() + b"\0\0\0", "zero byte"),
    "swallowed.obj": (b"g a \\\n" + OBJ.encode(), "ends in a backslash"),
    "underscore.obj": (OBJ.replace("v 1 ", "v 1_0 ", 1).encode(), "line 2: '1_0' is not a number"),
    "wide_space.obj": (OBJ.replace("f 1 ", "f\u00a01 ", 1).encode(), "line 9: .* is no statement, a vertex or face"),
    "huge.obj": (OBJ.replace("v 1 ", "v 1e200 ", 1).encode(), "must be at most 1e\\+100"),
    "count.stl": (BINARY_STL[:80] + struct.pack("<I", 6) + BINARY_STL[84:], "claims 6.*room for 12"),
    "header.stl": (34 * b"x", "shorter than its header"),
    "cut.stl": (BINARY_STL[:-60], "claims 12.*room for 10"),
    "cut_text.stl": (STL.split("endsolid")[0].encode(), "cut short: 12 whole"),
    "corners.stl": (STL.replace(" endloop", "  vertex 0 0 0\n endloop", 1).encode(), "three vertices; got 4"),
    "long_row.ply": (PLY.replace("0 0 0\n", "0 0 0 9\n", 1).encode(), "4 words in a row of vertex; 3 are declared"),
    "short_row.ply": (PLY.replace("0 0 0\n", "0 0\n", 1).encode(), "too short"),
    "more.ply": ((PLY + "4 0 1 2 3\n").encode(), "header does not declare"),
    "twice.ply": (PLY.replace("property float z", "property float z\nproperty float x").encode(), "declared twice"),
    "type.ply": (PLY.replace("property float z", "property quad z").encode(), "bad header line"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_read_rightly_is_refused_in_one_line_that_names_it(name, tmp_path):
    data, reason = REFUSED[name]
    (tmp_path / name).write_bytes(data)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(checks.InputError, match=reason) as caught:
        mesh_io.load(tmp_path / name)
    assert name in str(caught.value) and "\n" not in str(caught.value)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 64 * 1024


def test_faces_of_two_corners_are_counted_and_said():
    mesh = mesh_io.parse((OBJ + "f 1 2\nf 3 4\n").encode(), ".obj")
    assert len(mesh.faces) == 12 and mesh.remarks == ("2 faces of fewer than three corners are left out",)
    with pytest.raises(checks.InputError, match=r"no triangles found.*1 faces of fewer than three"):
        mesh_io.parse(b"v 0 0 0\nv 1 0 0\nf 1 2\n", ".obj")


def _binary_ply(order, index="i", extra=False):
    name = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    kind = {"i": "int", "H": "ushort", "B": "uchar"}[index]
    lines = f"ply\nformat {name} 1.0\nelement vertex 8\nproperty double x\nproperty double y\nproperty double z\n"
    lines += ("property uchar red\n" if extra else "") + "element face 9\n"
    lines += ("property uchar flag\n" if extra else "") + f"property list uchar {kind} vertex_index\n"
    data = (lines + ("property list uchar float uv\n" if extra else "") + "end_header\n").encode()
    for x, y, z in UNIT_CUBE:
        data += struct.pack(f"{order}3d", x, y, z) + (b"\7" if extra else b"")
    for n, quad in enumerate(QUADS):
        for part in [quad] if n % 2 else [[quad[0], *quad[1:3]], [quad[0], *quad[2:]]]:
            data += (b"\1" if extra else b"") + struct.pack(f"{order}B{len(part)}{index}", len(part), *part)
            data += struct.pack(f"{order}B{n}f", n, *range(n)) if extra else b""
    return data


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("index", "iHB")
@pytest.mark.parametrize("extra", [False, True])
def test_binary_ply_of_mixed_polygons_and_properties(order, index, extra):
    mesh = mesh_io.parse(_binary_ply(order, index, extra), ".ply")
    assert len(mesh.faces) == 12 and area_and_volume(mesh) == pytest.approx((6.0, 1.0))
    assert (mesh_io.ply.oriented(_binary_ply(order, index, extra))[0] == np.array(UNIT_CUBE)).all()
    for cut in (1, 20, 60):
        with pytest.raises(checks.InputError, match=r"file ends after|but the file has only"):
            mesh_io.parse(_binary_ply(order, index, extra)[:-cut], ".ply")


def test_triangle_strips_turn_every_second_triangle_and_end_at_minus_one():
    header = PLY.split("element face")[0] + "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    strip = [3, 2, 0, 1, -1, 4, 5, 7, 6, -1, 0, 1, 4, 5, -1, 1, 2, 5, 6, -1, 2, 3, 6, 7, -1, 3, 0, 7, 4]
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in UNIT_CUBE) + " ".join(map(str, [len(strip), *strip])) + "\n"
    mesh = mesh_io.parse((header + rows).encode(), ".ply")
    assert len(mesh.faces) == 12 and area_and_volume(mesh) == pytest.approx((6.0, 1.0))


def _glb(positions, indices=None, mode=4, normalized=False, node=None, extra=None, stride=0):
    body = b"".join(row.tobytes().ljust(stride or row.nbytes, b"\0") for row in positions)
    start = len(body) + -len(body) % 4
    data = body.ljust(start, b"\0") + (np.asarray(indices, "<u2").tobytes() if indices is not None else b"")
    types = {"float32": 5126, "int16": 5122, "int8": 5120, "uint16": 5123}
    primitive = {"attributes": {"POSITION": 0}, "mode": mode} | ({"indices": 1} if indices is not None else {})
    places = {"bufferView": 0, "componentType": types[positions.dtype.name], "count": len(positions), "type": "VEC3"}
    accessors = [places | ({"normalized": True} if normalized else {})]
    views = [{"buffer": 0, "byteLength": len(body)} | ({"byteStride": stride} if stride else {})]
    if indices is not None:
        accessors.append({"bufferView": 1, "componentType": 5123, "count": len(indices), "type": "SCALAR"})
        views.append({"buffer": 0, "byteOffset": start, "byteLength": 2 * len(indices)})
    tree = {"asset": {"version": "2.0"}, "buffers": [{"byteLength": len(data)}], "bufferViews": views}
    tree |= {"accessors": accessors, "meshes": [{"primitives": [primitive]}], "nodes": [{"mesh": 0, **(node or {})}]}
    text = json.dumps(tree | (extra or {})).encode()
    text, data = text + b" " * (-len(text) % 4), data + b"\0" * (-len(data) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float32)


@pytest.mark.parametrize(
    ("mode", "indices"), [(4, [0, 1, 2, 0, 2, 3]), (5, [0, 1, 3, 2]), (6, [0, 1, 2, 3]), (6, None)]
)
def test_glb_primitive_modes_cover_the_square_facing_up(mode, indices):
    mesh = mesh_io.parse(_glb(SQUARE, indices, mode), ".glb")
    normals, areas = mesh_io.face_normals(mesh)
    assert len(mesh.faces) == 2 and areas.sum() == pytest.approx(1.0) and (normals[:, 2] > 0.99).all()


@pytest.mark.parametrize(("kind", "top"), [(np.int8, 127), (np.int16, 32767), (np.uint16, 65535)])
def test_glb_normalized_integers_are_divided_and_others_are_not(kind, top):
    corners = (SQUARE * top).astype(kind)
    for normalized, size in ((True, 1.0), (False, float(top))):
        glb = _glb(corners, [0, 1, 2], normalized=normalized, node={"scale": [3, 3, 3]}, stride=12)
        assert mesh_io.parse(glb, ".glb").box()[1][0] == pytest.approx(3 * size)


def test_glb_mirrors_turn_their_triangles_and_transforms_follow_trimesh():
    node = {"rotation": [0.5, 0.5, 0.5, 0.5], "translation": [1, 2, 3], "scale": [2, 3, -1]}
    glb = _glb(SQUARE, [0, 1, 2, 0, 2, 3], node=node, extra={"scenes": [{"nodes": [0]}], "scene": 0})
    own = mesh_io.parse(glb, ".glb")
    other = trimesh.load_scene(trimesh.util.wrap_as_stream(glb), file_type="glb", process=False).to_mesh()
    np.testing.assert_allclose(own.triangles.mean(axis=1), np.array(other.triangles).mean(axis=1), atol=1e-6)
    np.testing.assert_allclose(mesh_io.face_normals(own)[0], other.face_normals, atol=1e-6)


@pytest.mark.parametrize(
    ("extra", "reason"),
    [
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "KHR_draco_mesh_compression"),
        ({"extensionsRequired": ["EXT_meshopt_compression"]}, "EXT_meshopt_compression"),
        ({"extensionsUsed": ["EXT_mesh_gpu_instancing"]}, "EXT_mesh_gpu_instancing"),
        ({"nodes": [{"mesh": 0, "children": [0]}], "scenes": [{"nodes": [0]}]}, "circle"),
        ({"nodes": [{"mesh": 7}]}, "not glTF"),
        ({"bufferViews": [{"buffer": 0, "byteLength": 10}, {"buffer": 0, "byteLength": 6}]}, "beyond its buffer"),
        ({"accessors": [{"count": 10**12}]}, "accessor entries"),
        ({"buffers": [{"byteLength": 4, "uri": "../secret.bin"}]}, "points outside"),
    ],
)
def test_glb_that_cannot_be_read_rightly_is_refused_by_name(extra, reason):
    with pytest.raises(checks.InputError, match=reason):
        mesh_io.parse(_glb(SQUARE, [0, 1, 2], extra=extra), ".glb")


def test_glb_points_and_lines_are_left_out_with_a_remark():
    with pytest.raises(checks.InputError, match="primitives of lines are left out"):
        mesh_io.parse(_glb(SQUARE, [0, 1], mode=1), ".glb")


@settings(max_examples=60, deadline=None)
@given(st.integers(3, 30), st.integers(1, 40), st.integers(0, 10**6), st.sampled_from(mesh_io.SUFFIXES))
def test_random_meshes_come_back_as_they_were_and_as_trimesh_reads_them(vertices, faces, seed, suffix):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(vertices, 3)) * 10.0 ** rng.integers(-3, 4)
    mesh = mesh_io.Mesh(points.astype(np.float32).astype(np.float64), rng.integers(0, vertices, (faces, 3)))
    data = mesh_io.export_bytes(mesh, suffix)
    again = mesh_io.parse(data, suffix).triangles
    if suffix in (".obj", ".off"):  # written with 17 decimals
        np.testing.assert_allclose(again, mesh.triangles, rtol=1e-9, atol=1e-16)
    else:
        assert np.array_equal(again, mesh.triangles)
    other = trimesh.load_scene(trimesh.util.wrap_as_stream(data), file_type=suffix[1:], process=False).to_mesh()
    np.testing.assert_allclose(other.triangles, mesh.triangles, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    ("node", "mesh", "volume"),
    [
        ({"rotation": [0, 0, 2**0.5, 2**0.5]}, {}, 0),
        ({"weights": [1]}, {"weights": [0]}, 1),
        ({"weights": [0]}, {"weights": [1]}, 0),
        ({}, {"weights": [1]}, 1),
    ],
)
def test_glb_rotations_have_norm_one_and_weights_of_nodes_win(node, mesh, volume):
    primitive = {"attributes": {"POSITION": 0}, "indices": 1}
    glb = _glb(SQUARE, [0, 1, 2, 0, 2, 3], node=node, extra={"meshes": [{"primitives": [primitive], **mesh}]})
    read = mesh_io.parse(glb, ".glb")
    assert area_and_volume(read)[0] == pytest.approx(1.0)
    assert read.remarks == ("morph targets are not applied",) * volume


def test_glb_json_padded_with_zeros_is_read_and_a_rotation_of_norm_zero_refused():
    glb = _glb(SQUARE, [0, 1, 2], extra={"a": "b"})
    end = glb.index(b"BIN") - 4
    text = glb[:end].rstrip(b" ")
    padded = text.ljust(end, b"\0") + glb[end:]
    assert padded != glb and len(mesh_io.parse(padded, ".glb").faces) == 1
    with pytest.raises(checks.InputError, match="rotation of a node must not be zero"):
        mesh_io.parse(_glb(SQUARE, [0, 1, 2], node={"rotation": [0, 0, 0, 0]}), ".glb")


def test_far_triangle_without_an_area_sets_no_box():
    ball = icosphere(1)
    for far in ([[1000, 0, 0]] * 3, [[0.1, 0.2, 0.3], [333.4, 666.9, 1000.2], [700.1 / 3, 1400.5 / 3, 2100.4 / 3]]):
        corners = np.array(far)
        if far[0] != far[1]:
            corners[2] = corners[0] + 0.7 * (corners[1] - corners[0])
        both = mesh_io.Mesh(np.concatenate([ball.vertices, corners]), np.concatenate([ball.faces, [[42, 43, 44]]]))
        assert both.box()[1].max() <= 1.0 and len(mesh_io.without_flat(both).faces) == len(ball.faces)
