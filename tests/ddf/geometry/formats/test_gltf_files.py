"""glTF as text: buffers beside the file and in it; nothing outside the folder is opened."""

import base64
import json

import numpy as np
import pytest
import trimesh
from _shapes import icosphere

from ddf.core import checks
from ddf.geometry import mesh_io

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype="<f4").tobytes()
FACES = np.array([0, 1, 2, 0, 2, 3], dtype="<u2").tobytes()


def _text(*uris, version="2.0", lengths=(48, 12), **extra):
    buffers = [{"byteLength": n} | ({"uri": uri} if uri else {}) for uri, n in zip(uris, lengths, strict=True)]
    tree = {
        "asset": {"version": version},
        "buffers": buffers,
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 1, "byteLength": 12}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"mesh": 0, "translation": [0, 0, 5]}],
        "scenes": [{"nodes": [0]}],
        **extra,
    }
    return json.dumps(tree).encode()


def _data(body):
    return "data:application/octet-stream;base64," + base64.b64encode(body).decode()


def test_buffers_beside_the_file_and_inside_it_are_read(tmp_path):
    (tmp_path / "my parts").mkdir()
    (tmp_path / "my parts" / "a 1.bin").write_bytes(SQUARE + b"spare")
    (tmp_path / "a.gltf").write_bytes(_text("my%20parts/a%201.bin", _data(FACES)))
    mesh = mesh_io.load(tmp_path / "a.gltf")
    assert mesh.box()[0].tolist() == [0, 0, 5] and mesh.box()[1].tolist() == [1, 1, 5]
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    marked = b"\xef\xbb\xbf" + _text(_data(SQUARE), _data(FACES))
    assert np.array_equal(mesh_io.parse(marked, ".gltf").faces, mesh.faces)


def test_what_trimesh_writes_is_read_as_the_glb_is(tmp_path):
    scene = trimesh.Scene()
    ball = icosphere(1)
    part = trimesh.Trimesh(ball.vertices, ball.faces, process=False)
    for matrix in (np.diag([2.0, 2, -2, 1]), trimesh.transformations.translation_matrix([3, 1, 4])):
        scene.add_geometry(part, transform=matrix)
    files = scene.export(file_type="gltf")
    assert isinstance(files, dict)
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    (tmp_path / "model.glb").write_bytes(scene.export(file_type="glb"))
    apart, whole = (mesh_io.load(tmp_path / f"model.{kind}") for kind in ("gltf", "glb"))
    assert np.array_equal(apart.triangles, whole.triangles) and len(apart.faces) == 2 * len(ball.faces)


OUTSIDE = ("../secret.bin", "%2e%2e/secret.bin", "/etc/hostname", "https://a.b/c.bin", "a/../../secret.bin", "link.bin")


@pytest.mark.parametrize("uri", [*OUTSIDE, "file:///etc/hostname", "..\\secret.bin"])
def test_no_buffer_outside_the_folder_is_opened(tmp_path, uri):
    (tmp_path / "secret.bin").write_bytes(SQUARE)
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "link.bin").symlink_to(tmp_path / "secret.bin")
    (tmp_path / "in" / "a.gltf").write_bytes(_text(uri, _data(FACES)))
    with pytest.raises(checks.InputError, match=r"a\.gltf: buffer .*: must lie in the folder of the file"):
        mesh_io.load(tmp_path / "in" / "a.gltf")


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (_text("gone.bin", _data(FACES)), "'gone.bin': no such file"),
        (_text("a\0b", _data(FACES)), "cannot be read|no such file"),
        (_text("x" * 5000, _data(FACES)), "cannot be read|no such file"),
        (_text(None, _data(FACES)), "buffer 0 has no data"),
        (_text(_data(SQUARE[:-1]), _data(FACES)), "cut short: a buffer of 48 bytes, 47 are there"),
        (_text("data:text/plain,abc", _data(FACES)), "must be base64"),
        (_text("data:;base64,a$b", _data(FACES)), "is not base64"),
        (_text(_data(SQUARE), _data(FACES), version="1.0"), "glTF version 1.0 is not read"),
        (_text(_data(SQUARE), _data(FACES), lengths=(48, 10**10)), "more than 268435456 bytes"),
        (b"{}", "not glTF"),
        (b"glTF", "cannot be read"),
    ],
)
def test_text_files_that_cannot_be_read_rightly_say_why(tmp_path, data, reason):
    (tmp_path / "a.gltf").write_bytes(data)
    with pytest.raises(checks.InputError, match=reason):
        mesh_io.load(tmp_path / "a.gltf")
