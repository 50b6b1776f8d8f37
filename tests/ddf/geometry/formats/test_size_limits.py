"""Files at the readers' limits whose last line is at fault: refused within 10 s of a core and 1 GiB more memory.

The worst that we know of each format; one process a file.
"""

import io
import struct
import subprocess
import sys
import zipfile

import pytest
from PIL import Image

from ddf.geometry import mesh_io

LIMIT, XML, JSON = mesh_io.MAX_FILE_BYTES, 128 << 20, 64 << 20
MANY, LINES = 10**9, 11_990_000
PLY = "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\n"
PLY += "property list uchar int vertex_indices\nend_header\n"
CORE = b'<model xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources><object id="1"><mesh>'
FACET = b"facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
PLACE = b"0.123456 -0.654321 0.111111"
SQUARE = b"v 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 0.5 0\nv 0 2 0\n"
ROWS, STL = (LIMIT - 100) // 28, (LIMIT - 84) // 50
FACES = PLY.format("ascii", 3, 7_999_999).encode() + b"0 0 0\n" * 3
VERTICES = PLY.format("binary_little_endian", 15_900_000, 1).encode()
NAN = struct.pack("<12fH", *[float("nan")] * 12, 0)
BINARY = PLY.format("binary_little_endian", 3, 7_999_999).encode() + bytes(36)
UNEVEN = struct.pack("<B3iB4i", 3, 0, 1, 2, 4, 0, 1, 2, 0)
NODES = b'{"asset":{"version":"2.0"},"nodes":['
# Name: the beginning, a row, the end, how many rows, and how many bytes at most.
REPEATED = {
    "vertices.obj": (b"", b"v " + PLACE + b"\n", b"v 0 x 0\n", LINES, LIMIT),
    "short_vertices.obj": (b"", b"v 0 0 0\n", b"v 0 x 0\n", LINES, LIMIT),
    "mixed.obj": (SQUARE, b"v 0.1 0.2 0.3\nf -1/2/3 -2//1 -3\n", b"f 1 2 99999999\n", 5_990_000, LIMIT),
    "quads.obj": (SQUARE, b"f 1 2 3 4\n", b"f 1 2\nf 1 2 9\n", 5_990_000, LIMIT),
    "concave.obj": (SQUARE, b"f 1 2 3 4 5\n", b"f 1 2 9\n", 4_700_000, LIMIT),
    "corners.obj": (SQUARE, b"f" + b" 1 2 3 4" * 20_000 + b"\n", b"f 1 2 9\n", MANY, LIMIT),
    "by_word.obj": (SQUARE, b"V 0 0 0\nF 1 2 3\n", b"f 1 2 9\n", 5_990_000, LIMIT),
    "continued.obj": (SQUARE, b"f 1 2 \\\n3\n", b"f 1 2 9\n", 5_990_000, LIMIT),
    "backslashes.obj": (SQUARE, b"# \\\n", b"f 1 2 9\n", LINES, LIMIT),
    "rows.off": (f"OFF\n{ROWS} 9 0\n".encode(), PLACE + b"\n", b"", ROWS, LIMIT),
    "faces.off": (b"OFF\n3 7999999 0\n0 0 0\n1 0 0\n0 1 0\n", b"3 0 1 2\n", b"3 0 1\n", 7_999_998, LIMIT),
    "comments.off": (b"OFF\n", b"#\n", b"3 1 0\n", LINES, LIMIT),
    "rows.ply": (PLY.format("ascii", ROWS - 9, 9).encode(), PLACE + b"\n", b"", ROWS - 9, LIMIT),
    "faces.ply": (FACES, b"3 0 1 2\n", b"3 0 1\n", 7_999_998, LIMIT),
    "uneven.ply": (BINARY, UNEVEN, struct.pack("<B3i", 3, 0, 1, 9), 3_999_999, LIMIT),
    "vertices_binary.ply": (VERTICES, struct.pack("<3f", 1, 2, 3), b"\3", 15_900_000, LIMIT),
    "text.stl": (b"solid a\n", FACET, b"", 1_700_000, LIMIT),
    "solids.stl": (b"", b"solid a\n" + FACET + b"endsolid\n", b"facet\n", 1_330_000, LIMIT),
    "counts.stl": (bytes(80) + struct.pack("<I", LIMIT // 50 + 9), bytes(50), b"", LIMIT // 50, LIMIT),
    "nan.stl": (bytes(80) + struct.pack("<I", STL), bytes(50), NAN, STL - 1, LIMIT),
    "numbers.dae": (b"<COLLADA><float_array>", PLACE + b" ", b"", MANY, XML),
    "elements.dae": (b"<COLLADA>", b'<a id="1"/>', b"", MANY, XML),
    "line_ends.dae": (b"<COLLADA>", b"\n", b"", MANY, XML),
    "vertices.3mf": (CORE + b"<vertices>", b'<vertex x="0.123456" y="-0.654321" z="0.111111"/>', b"", MANY, XML),
    "triangles.3mf": (CORE, b'<triangle v1="0" v2="1" v3="2"/>\n', b"", MANY, XML),
    "empty.3mf": (CORE, b"<a/>", b"", MANY, XML),
    "zeros.3mf": (b"", b"\0", b"", MANY, 2 << 30),
    "brackets.gltf": (b"[", b"[],", b"[]]", 999_997, JSON),
    "floats.gltf": (b"[", b"1.5,", b"2]", 7_990_000, JSON),
    "nodes.gltf": (NODES, b"{},", b'{"mesh":0}]}', 990_000, JSON),
}


def _doubled_nodes():
    """60 nodes, each of which places the next one twice."""
    node = b'<node id="n%d"><scale>1 1 1</scale><instance_node url="#n%d"/><instance_node url="#n%d"/></node>'
    scene = b'<library_visual_scenes><visual_scene id="s"><node><instance_node url="#n0"/></node></visual_scene>'
    nodes = b"".join(node % (i, i + 1, i + 1) for i in range(60)) + b'<node id="n60"/>'
    return b"<COLLADA>" + scene + b"</library_visual_scenes><library_nodes>" + nodes + b"</library_nodes></COLLADA>"


def _accessors():
    entries = b'{"asset":{"version":"2.0"},"accessors":[' + b'{"count":1},' * 450_000 + b'{}],"buffers":['
    return entries + b'{"byteLength":0,"uri":"data:;base64,"},' * 450_000 + b"{}]}"


def _transparent():
    stream = io.BytesIO()
    Image.new("RGBA", (7071, 7071)).save(stream, "PNG", compress_level=1)
    return stream.getvalue()


MADE = {
    "attributes.dae": lambda: b"<COLLADA " + b" ".join(b'a%d=""' % i for i in range(9_000_000)) + b">",
    "doubled_nodes.dae": _doubled_nodes,
    "accessors.gltf": _accessors,
    "large.png": _transparent,
}
READ = """
import sys, time
from pathlib import Path
from ddf.core import checks
from ddf.data import cutouts
from ddf.geometry import mesh_io
def peak():
    return int(Path('/proc/self/status').read_text().partition('VmHWM:')[2].split()[0]) >> 10
base, began, path = peak(), time.process_time(), Path(sys.argv[1])
try:
    cutouts.read(path) if path.suffix == '.png' else mesh_io.load(path)
except checks.InputError:
    print(time.process_time() - began, peak() - base)
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", [*REPEATED, *MADE])
def test_files_at_the_limits_are_refused_within_bounds(name, tmp_path):
    if name in MADE:
        data = MADE[name]()
    else:
        head, row, tail, times, size = REPEATED[name]
        data = head + row * min(times, (size - len(head) - len(tail)) // len(row)) + tail
    path = tmp_path / name
    if name.endswith(".3mf"):
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            archive.writestr("3D/3dmodel.model", data)
    else:
        path.write_bytes(data)
    del data
    done = subprocess.run([sys.executable, "-c", READ, str(path)], capture_output=True, text=True, check=False)
    path.unlink()
    assert done.stdout, f"read, or failed: {done.stderr[-300:]}"
    seconds, grown_mib = map(float, done.stdout.split())
    assert seconds < 10
    assert grown_mib < 1024
