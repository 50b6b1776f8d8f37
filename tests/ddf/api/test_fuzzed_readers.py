"""Mutated files into the readers: each is read, or refused in one line, without a warning, in bounded time."""

import contextlib
import io
import json
import math
import time
import warnings
import zlib

import _shapes
import numpy as np
import pytest
import safetensors.numpy
import trimesh
from PIL import Image

import ddf
from ddf.api import scene as scenes
from ddf.core import checks, storage
from ddf.data import cutouts
from ddf.fields import field_file, pddf, shape_field
from ddf.fields.grid import octree, patch_field
from ddf.fit import fit_folder
from ddf.geometry import mesh_io, scans, transforms
from ddf.io import onnx_field, onnx_file, onnx_graphs, patch_graph

_BALL = trimesh.creation.icosphere(subdivisions=1)
_MESH = mesh_io.Mesh(np.array(_BALL.vertices), np.array(_BALL.faces))
_WORDS = (b"-1", b"0", b"1e999", b"nan", b"99999999999", b"\\", b"#", b"\r", b"\0", b"\xff\xfe", b"end_header", b"list")


def seeds():
    """Small whole files of every format and encoding."""
    found = [(suffix, mesh_io.export_bytes(_MESH, suffix)) for suffix in mesh_io.SUFFIXES]
    polygons = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\n"
    found.append((".obj", (polygons + "f 1 2 3 4 5 6\nf -6//1 -5/2 -4 \\\n -3\n").encode()))
    rows = "0 0 0\n2 0 0\n2 1 0\n1 1 0\n1 2 0\n0 2 0\n"
    found.append((".off", f"OFF\n6 2 0\n{rows}6 0 1 2 3 4 5\n3 0 1 2\n".encode()))
    header = "ply\nformat {} 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
    header += "element {} 2\nproperty list uchar int vertex_indices\nend_header\n"
    lists = "6 0 1 2 3 4 5\n3 0 1 2\n"
    found += [(".ply", f"{header.format('ascii', each)}{rows}{lists}".encode()) for each in ("face", "tristrips")]
    positions = np.array([row.split() for row in rows.splitlines()], dtype=">f4").tobytes()
    lists = b"\6" + np.arange(6, dtype=">i4").tobytes() + b"\3" + np.arange(3, dtype=">i4").tobytes()
    found.append((".ply", header.format("binary_big_endian", "face").encode() + positions + lists))
    found.append((".stl", str(_BALL.export(file_type="stl_ascii")).encode()))
    return [*found, (".gltf", _GLTF), (".dae", _DAE), (".3mf", _3MF)]


_GLTF = json.dumps(
    {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": 36, "uri": "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "nodes": [{"mesh": 0, "scale": [1, 2, -3], "rotation": [0, 0, 0, 1], "children": [1]}, {"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
).encode()
_DAE = b"""<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh><source id="s"><float_array id="a" count="18">0 0 0 2 0 0 2 1 0 1 1 0 1 2 0 0
2 0</float_array><technique_common><accessor source="#a" count="6" stride="3"/></technique_common></source><vertices
id="v"><input semantic="POSITION" source="#s"/></vertices><polylist count="2"><input semantic="VERTEX" source="#v"
offset="0"/><vcount>6 3</vcount><p>2 3 4 5 0 1 0 1 2</p></polylist><tristrips count="1"><input semantic="VERTEX"
source="#v" offset="0"/><p>0 1 5 4</p></tristrips></mesh></geometry></library_geometries><library_visual_scenes>
<visual_scene id="c"><node><rotate>0 0 1 30</rotate><scale>1 -1 1</scale><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#c"/></scene></COLLADA>"""
_3MF = b"""<model xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02" unit="millimeter"><resources><object
id="1"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/></vertices>
<triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh></object><object id="2"><components><component
objectid="1" transform="1 0 0 0 1 0 0 0 1 5 0 0"/></components></object></resources><build><item objectid="2"/></build>
</model>"""


def pictures():
    """Small whole pictures: PNG of several kinds, JPEG, WebP, GIF and BMP, some with an EXIF record."""
    rng = np.random.default_rng(1)
    pixels = rng.integers(0, 256, (20, 24, 4)).astype(np.uint8)
    pixels[..., 3] = np.where(np.indices((20, 24)).sum(0) < 24, 255, 0)
    image, exif = Image.fromarray(pixels), Image.Exif()
    exif[0x0112] = 6
    kinds = [
        ("png", image, {"exif": exif}),
        ("png", image.convert("P"), {}),
        ("jpeg", image.convert("RGB"), {"exif": exif}),
        ("webp", image, {"lossless": True, "exif": exif}),
        ("webp", image, {"quality": 60}),
        ("gif", image.convert("P"), {}),
        ("bmp", image.convert("RGB"), {}),
    ]
    found = []
    for kind, picture, options in kinds:
        stream = io.BytesIO()
        picture.save(stream, format=kind, **options)
        found.append((f".{kind}", stream.getvalue()))
    return found


def mutated(data, rng):
    """The file with some bytes changed, words put in, parts cut, doubled or moved."""
    work = bytearray(data)
    for _ in range(int(rng.integers(1, 6))):
        place, stop = sorted(int(i) for i in rng.integers(0, len(work) + 1, 2))
        kind = rng.integers(0, 7)
        if kind <= 1 and place < len(work):
            work[place] = int(rng.integers(0, 256))
        elif kind == 2:
            word = _WORDS[int(rng.integers(0, len(_WORDS)))]
            work[place : place + len(word) * int(rng.integers(0, 2))] = word
        elif kind == 3 and place + 4 <= len(work):
            work[place : place + 4] = int(rng.choice([0, 1, 255, 2**31 - 1, 2**31, 2**32 - 1])).to_bytes(4, "little")
        elif kind == 4:
            del work[place : min(stop, place + 64)]
        elif kind == 5:
            work[place:place] = work[place : min(stop, place + 64)]
        elif rng.integers(0, 4) == 0:
            del work[stop:]
    return bytes(work)


_FIELD = pddf.PDDF(pddf.PDDFConfig((8, 8), 1.0, 1.0, "softplus", 10.0))
_HEAD = {"format_version": 1, "steps": 3, "fingerprint": "a"}
_PATCHES = patch_field.fitted(*fit_folder.in_cube(_MESH), octree.PatchConfig(1e-2, depth=1))
_RECORD = (
    _HEAD
    | {"kind": "single_shape"}
    | shape_field.description(_FIELD.config, -np.ones(3), np.ones(3), transforms.Similarity(2.0))
)
_ODD = (None, True, -1, 0, 2, 1 << 62, 10**400, 1e308, math.nan, math.inf, "", "a", "1", [], {}, [[1]], {"a": 1})
_SCENE = b"""objects:
  - {field: rabbit, scale: 1e-1, rotation_deg: [0, 0x10, .5], translation: [1, 2, 3]}
  - field: rabbit
    translation: [1, 2, 3]
box: {lower: [-1, -1, -1], upper: [1, 1, 1]}
soft: ~
fly: [{position: [0, 0, 2], target: [0, 0, 0]}]
"""


def _graphs():
    """A small network and a few patches as ONNX files."""
    asked, facts = ("visibility", "depth", "normals"), {"transform": _RECORD["field_from_mesh"]}
    graphs = onnx_graphs.FieldGraph(_FIELD, asked), patch_graph.PatchGraph(patch_field.of(*_PATCHES), asked)
    return [(".onnx", onnx_file.to_onnx(graph, facts)) for graph in graphs]


def _broken(tree, rng):
    """A record with one part of it, somewhere, replaced or left out."""
    if not isinstance(tree, dict | list) or not tree or rng.integers(0, 4) == 0:
        return _ODD[int(rng.integers(0, len(_ODD)))]
    keys = list(tree) if isinstance(tree, dict) else list(range(len(tree)))
    key = keys[int(rng.integers(0, len(keys)))]
    if rng.integers(0, 5) == 0:
        rest = [(k, tree[k]) for k in keys if k != key]
        return dict(rest) if isinstance(tree, dict) else [value for _, value in rest]
    pairs = [(k, _broken(tree[k], rng) if k == key else tree[k]) for k in keys]
    return dict(pairs) if isinstance(tree, dict) else [value for _, value in pairs]


def read_record(data, _, path):
    """A field with this record, read by torch and without, and asked."""
    _write({name: value.numpy() for name, value in _FIELD.state_dict().items()}, json.loads(data), path)
    with np.errstate(all="ignore"):
        field_file.read(path).layers()
        ddf.load(path).query([[0.0, 0.0, 3.0]], [[0.0, 0.0, -1.0]])


def _write(arrays, record, path):
    """The file of a field with a right checksum: what is broken is the content itself."""
    if isinstance(record, dict):
        with contextlib.suppress(ValueError):  # of a NaN, which no file of ours has
            record["checksum"] = storage._content_checksum(arrays, record)
    safetensors.numpy.save_file(arrays, path / "model.safetensors", {"ddf": json.dumps(record)})


def read_patches(data, _, path):
    """As `read_record`, of patches; half of the files have a bit flipped in one of their arrays besides."""
    rng, record = np.random.default_rng(zlib.crc32(data)), json.loads(data)
    arrays = {name: value.copy() for name, value in _PATCHES[0].items()}
    if rng.integers(0, 2):
        flipped = arrays[rng.choice(sorted(arrays))].view(np.uint8).reshape(-1)
        flipped[rng.integers(0, len(flipped))] ^= 1 << rng.integers(0, 8)
    _write(arrays, record, path)
    with np.errstate(all="ignore"):
        field = ddf.load(path)
        field.query([[0.0, 0.1, 3.0], [0.0, 0.1, 0.2]], [[0.0, 0.0, -1.0]] * 2, field.outputs)
        field.points(9)


def _at(name, read):
    """Reads a file of this name."""

    def reading(data, _, folder):
        (folder / name).write_bytes(data)
        read(folder / name)

    return reading


def _scans():
    """NPZ files of the three kinds, and a PNG."""
    eye, found = np.eye(3), []
    lens, image = np.array([[4, 0, 3], [0, 4, 3], [0, 0, 1.0]]), np.full((6, 6), 2, np.uint16)
    for arrays in (
        {"positions": eye, "directions": eye, "ranges": np.array([1.0, 2, np.inf])},
        {"depth": image, "intrinsics": lens, "camera_to_scan": np.eye(4)},
        {"points": eye, "sensors": np.full(3, 2.0)},
    ):
        stream = io.BytesIO()
        np.savez(stream, allow_pickle=False, **arrays)
        found.append((".npz", stream.getvalue()))
    stream = io.BytesIO()
    Image.fromarray(image).save(stream, format="PNG")
    return [*found, (".png", stream.getvalue())]


def read_scan(data, suffix, path):
    """A scan; beside a PNG stands its JSON."""
    (path / f"scan{suffix}").write_bytes(data)
    (path / "scan.json").write_text('{"intrinsics": [[4, 0, 3], [0, 4, 3], [0, 0, 1]]}')
    scans.read(path / f"scan{suffix}")


def _changed(suffix, data, rng):
    """A mutated file; of a ZIP file sometimes the archive, mostly what it holds."""
    if suffix == ".record":
        return json.dumps(_broken(json.loads(data), rng)).encode()
    if suffix != ".3mf":
        return mutated(data, rng)
    name = "3D/3dmodel.model"
    if rng.integers(0, 4) == 0:
        return mutated(_shapes.zipped({name: data}), rng)
    return _shapes.zipped({name: mutated(data, rng)})


# Kind: how many files, whole files of that kind, and what reads one with this suffix in a folder.
KINDS = {
    "meshes": (300, seeds, lambda data, suffix, _: mesh_io.parse(data, suffix)),
    "pictures": (100, pictures, _at("picture", cutouts.read)),
    "records": (100, lambda: [(".record", json.dumps(_RECORD).encode())], read_record),
    "patches": (100, lambda: [(".record", json.dumps(_HEAD | _PATCHES[1]).encode())], read_patches),
    "graphs": (100, _graphs, _at("field.onnx", onnx_field.load)),
    "scans": (200, _scans, read_scan),
    "scenes": (100, lambda: [(".yaml", _SCENE)], _at("scene.yaml", scenes.read_content)),
}


@pytest.mark.parametrize("kind", KINDS)
def test_broken_files_are_read_or_refused_in_one_line(kind, tmp_path):
    count, whole_files, read = KINDS[kind]
    rng, files, refused, slowest = np.random.default_rng(0), whole_files(), 0, 0.0
    read(files[0][1], files[0][0], tmp_path)  # what is compiled at the first call is compiled here
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for i in range(count):
            suffix, whole = files[i % len(files)]
            data = _changed(suffix, whole, rng)
            begin = time.process_time()
            try:
                read(data, suffix, tmp_path)
            except checks.InputError as fault:
                assert "\n" not in str(fault)
                assert len(str(fault)) < 500
                refused += 1
            slowest = max(slowest, time.process_time() - begin)
    assert count / 3 < refused < count
    assert slowest < 5
