"""Reading meshes and clouds: every format to the same triangles or points, every broken file to one line."""

import json
import struct

import numpy as np
import open3d as o3d
import pytest
import trimesh
from _shapes import cube, icosphere, moved
from _support import assert_close

from ddf.core import checks
from ddf.geometry import mesh_io


@pytest.mark.parametrize("suffix", mesh_io.SUFFIXES)
def test_far_meshes_come_back_to_a_millionth_from_formats_of_float32_and_to_the_bit_from_others(suffix):
    near, place = icosphere(1), np.array([500123.761, 4649776.48, -250.67])
    far = moved(near, 0.4, tuple(place))
    data = mesh_io.export_bytes(far, suffix)
    off = 4e-7 if suffix in (".stl", ".glb") else 0.0
    assert_close(mesh_io.parse(data, suffix).triangles, far.triangles, rtol=0, atol=off)
    other = trimesh.load_scene(trimesh.util.wrap_as_stream(data), file_type=suffix[1:], process=False).to_mesh()
    shift = mesh_io.told_origin(far.vertices) if suffix == ".stl" else 0.0  # that its header tells, and no other reader
    assert_close(other.triangles + shift, far.triangles, rtol=0, atol=1e-6)
    assert b"less" not in mesh_io.export_bytes(near, suffix)[:80] and not mesh_io.told_origin(near.vertices).any()


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.zeros((2, 3)), np.full((2, 3), 1e300)])
def test_clouds_of_no_extent_have_an_origin_too(points):
    assert_close(mesh_io.told_origin(points), points.sum(axis=0) / max(1, len(points)), rtol=1e-8, atol=0)


def test_box_ignores_vertices_that_no_triangle_uses():
    mesh = mesh_io.Mesh(np.concatenate([cube().vertices, [[100.0, 0, 0]]]), cube().faces)
    assert mesh.box()[1].max() == 1
    assert_close(mesh.diagonal(), 2 * np.sqrt(3))


@pytest.mark.real
def test_real_bad_files_are_refused(shared_dir):
    for path in sorted((shared_dir / "meshes").glob("bad_*")):
        with pytest.raises(checks.InputError, match=path.name):
            mesh_io.load(path)


def test_a_file_without_a_surface_is_named(tmp_path):
    path = tmp_path / "line.obj"
    path.write_text("v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\n")
    assert len(mesh_io.load(path).faces) == 1
    with pytest.raises(checks.InputError, match=r"line\.obj: no triangle has an area"):
        mesh_io.load_surface(path)
    path.write_text("v 0 0 0\nv 1 1 1\nv 2 2 2\nv 0 1 0\nf 1 2 3\nf 1 2 4\n")
    assert len(mesh_io.load_surface(path).faces) == 2


def test_glb_has_linear_colours_unit_normals_and_a_rough_material(tmp_path):
    vertices, faces = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0]]), np.array([[0, 1, 2]])
    colours, normals = np.array([[0, 188, 255]] * 3, np.uint8), np.array([[0.0, 0, 1], [1, 0, 0], [0, 0, 0]])
    mesh_io.Mesh(vertices, faces, colours=colours, normals=normals).save(tmp_path / "one.glb")
    data = (tmp_path / "one.glb").read_bytes()
    magic, version, length, size = struct.unpack_from("<4sIII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data)) and size % 4 == 0
    tree, found = json.loads(data[20 : 20 + size]), {}
    for name, number in tree["meshes"][0]["primitives"][0]["attributes"].items():
        view = tree["bufferViews"][tree["accessors"][number]["bufferView"]]
        found[name] = np.frombuffer(data, "<f4", 9, 20 + size + 8 + view["byteOffset"]).reshape(3, 3)
    np.testing.assert_array_equal(found["POSITION"], vertices)
    np.testing.assert_allclose(found["COLOR_0"], [[0, 0.5, 1]] * 3, atol=0.004)  # sRGB 188 is half the light
    np.testing.assert_allclose(np.linalg.norm(found["NORMAL"], axis=1), 1)
    assert tree["accessors"][0]["min"] == [0, 0, 0] and tree["accessors"][0]["max"] == [1, 2, 0]
    assert tree["materials"][0]["pbrMetallicRoughness"] == {"metallicFactor": 0.0, "roughnessFactor": 0.9}


_POINTS = np.random.default_rng(0).normal(size=(37, 3))


def _header(form, count):
    columns = "".join(f"property double {axis}\n" for axis in "xyz")
    return f"ply\nformat {form} 1.0\ncomment x\nelement vertex {count}\n{columns}"


@pytest.mark.parametrize(("form", "order"), [("binary_little_endian", "<"), ("binary_big_endian", ">"), ("ascii", "")])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_all_encodings_give_the_points(tmp_path, form, order, newline):
    header = (_header(form, len(_POINTS)) + "end_header\n").replace("\n", newline).encode()
    rows = [" ".join(map(repr, row)) for row in _POINTS.tolist()]
    body = _POINTS.astype(f"{order}f8").tobytes() if order else "\n".join(rows).encode()
    path = tmp_path / "a.ply"
    path.write_bytes(header + body)
    np.testing.assert_array_equal(mesh_io.read_points(path), _POINTS)


@pytest.mark.parametrize("ascii_form", [False, True])
def test_reads_what_open3d_writes_and_writes_what_open3d_reads(tmp_path, ascii_form):
    path = str(tmp_path / "a.ply")
    o3d.io.write_point_cloud(path, o3d.geometry.PointCloud(o3d.utility.Vector3dVector(_POINTS)), write_ascii=ascii_form)
    np.testing.assert_allclose(mesh_io.read_points(path), _POINTS, atol=1e-5)
    (tmp_path / "b.ply").write_bytes(mesh_io.points_ply(_POINTS))
    read = np.asarray(o3d.io.read_point_cloud(str(tmp_path / "b.ply")).points)
    np.testing.assert_array_equal(read, _POINTS)
    np.testing.assert_array_equal(mesh_io.read_points(tmp_path / "b.ply"), _POINTS)


def test_a_cloud_of_no_points_is_refused_by_name(tmp_path):
    path = tmp_path / "none.ply"
    path.write_text(_header("ascii", 0) + "end_header\n")
    with pytest.raises(checks.InputError, match=r"none\.ply: the cloud has no points"):
        mesh_io.read_points(path)
