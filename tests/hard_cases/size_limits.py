"""Files at the readers' limits whose last line is at fault: seconds of one core and memory until they are refused.

    python tests/hard_cases/size_limits.py

One process a file; writes the entry `limits` of reports/hard_cases_readers.json. The worst that we know of each format.
"""

import json
import resource
import struct
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

from PIL import Image

from ddf.geometry import mesh_io

OUT = Path(__file__).resolve().parents[2] / "reports" / "hard_cases_readers.json"
LIMIT = mesh_io.MAX_FILE_BYTES
_LINES = 11_990_000
_HEADER = (
    "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\n"
)
_HEADER += "property list uchar int vertex_indices\nend_header\n"
_CORE = b'<model xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources><object id="1"><mesh>'
_FACET = b"facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
_PLACE = b"0.123456 -0.654321 0.111111"


def _repeated(head: bytes, row: bytes, tail: bytes, times: int, size: int = LIMIT) -> bytes:
    return head + row * min(times, (size - len(head) - len(tail)) // len(row)) + tail


def files() -> Iterator[tuple[str, bytes]]:
    """Names and contents."""
    square = b"v 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 0.5 0\nv 0 2 0\n"
    yield "vertices.obj", _repeated(b"", b"v " + _PLACE + b"\n", b"v 0 x 0\n", _LINES)
    yield "short_vertices.obj", _repeated(b"", b"v 0 0 0\n", b"v 0 x 0\n", _LINES)
    mixed = b"v 0.1 0.2 0.3\nf -1/2/3 -2//1 -3\n"
    yield "mixed.obj", _repeated(square, mixed, b"f 1 2 99999999\n", 5_990_000)
    yield "quads.obj", _repeated(square, b"f 1 2 3 4\n", b"f 1 2\nf 1 2 9\n", 5_990_000)
    yield "concave.obj", _repeated(square, b"f 1 2 3 4 5\n", b"f 1 2 9\n", 4_700_000)
    yield "corners.obj", _repeated(square, b"f" + b" 1 2 3 4" * 20_000 + b"\n", b"f 1 2 9\n", 10**9)
    yield "by_word.obj", _repeated(square, b"V 0 0 0\nF 1 2 3\n", b"f 1 2 9\n", 5_990_000)
    yield "continued.obj", _repeated(square, b"f 1 2 \\\n3\n", b"f 1 2 9\n", 5_990_000)
    yield "backslashes.obj", _repeated(square, b"# \\\n", b"f 1 2 9\n", _LINES)
    rows = (LIMIT - 100) // 28
    yield "rows.off", _repeated(f"OFF\n{rows} 9 0\n".encode(), _PLACE + b"\n", b"", rows)
    yield "faces.off", _repeated(b"OFF\n3 7999999 0\n0 0 0\n1 0 0\n0 1 0\n", b"3 0 1 2\n", b"3 0 1\n", 7_999_998)
    yield "comments.off", _repeated(b"OFF\n", b"#\n", b"3 1 0\n", _LINES)
    yield "rows.ply", _repeated(_HEADER.format("ascii", rows - 9, 9).encode(), _PLACE + b"\n", b"", rows - 9)
    head = _HEADER.format("ascii", 3, 7_999_999).encode() + b"0 0 0\n" * 3
    yield "faces.ply", _repeated(head, b"3 0 1 2\n", b"3 0 1\n", 7_999_998)
    binary = _HEADER.format("binary_little_endian", 3, 7_999_999).encode() + bytes(36)
    uneven = struct.pack("<B3iB4i", 3, 0, 1, 2, 4, 0, 1, 2, 0)
    yield "uneven.ply", _repeated(binary, uneven, struct.pack("<B3i", 3, 0, 1, 9), 3_999_999)
    head = _HEADER.format("binary_little_endian", 15_900_000, 1).encode()
    yield "vertices_binary.ply", _repeated(head, struct.pack("<3f", 1, 2, 3), b"\3", 15_900_000)
    yield "text.stl", _repeated(b"solid a\n", _FACET, b"", 1_700_000)
    yield "solids.stl", _repeated(b"", b"solid a\n" + _FACET + b"endsolid\n", b"facet\n", 1_330_000)
    yield "counts.stl", _repeated(bytes(80) + struct.pack("<I", LIMIT // 50 + 9), bytes(50), b"", LIMIT // 50)
    count = (LIMIT - 84) // 50
    lost = struct.pack("<12fH", *[float("nan")] * 12, 0)
    yield "nan.stl", _repeated(bytes(80) + struct.pack("<I", count), bytes(50), lost, count - 1)
    yield from _scenes()


def _scenes() -> Iterator[tuple[str, bytes]]:
    xml = 128 << 20
    yield "numbers.dae", _repeated(b"<COLLADA><float_array>", _PLACE + b" ", b"", 10**9, xml)
    yield "elements.dae", _repeated(b"<COLLADA>", b'<a id="1"/>', b"", 10**9, xml)
    yield "line_ends.dae", _repeated(b"<COLLADA>", b"\n", b"", 10**9, xml)
    yield "attributes.dae", b"<COLLADA " + b" ".join(b'a%d=""' % i for i in range(9_000_000)) + b">"
    shape = b'<library_visual_scenes><visual_scene id="s"><node><instance_node url="#n0"/></node></visual_scene>'
    shape += b"</library_visual_scenes>"
    nodes = b"".join(
        b'<node id="n%d"><scale>1 1 1</scale><instance_node url="#n%d"/><instance_node url="#n%d"/></node>'
        % (i, i + 1, i + 1)
        for i in range(60)
    )
    yield (
        "doubled_nodes.dae",
        b"<COLLADA>" + shape + b"<library_nodes>" + nodes + b'<node id="n60"/></library_nodes></COLLADA>',
    )
    vertices = _repeated(_CORE + b"<vertices>", b'<vertex x="0.123456" y="-0.654321" z="0.111111"/>', b"", 10**9, xml)
    yield "vertices.3mf", _zipped(vertices)
    yield "triangles.3mf", _zipped(_repeated(_CORE, b'<triangle v1="0" v2="1" v3="2"/>\n', b"", 10**9, xml))
    yield "empty.3mf", _zipped(_repeated(_CORE, b"<a/>", b"", 10**9, xml))
    yield "zeros.3mf", _zipped(bytes(2 << 30))
    yield "brackets.gltf", _repeated(b"[", b"[],", b"[]]", 999_997, 64 << 20)
    yield "floats.gltf", _repeated(b"[", b"1.5,", b"2]", 7_990_000, 64 << 20)
    nodes = _repeated(b'{"asset":{"version":"2.0"},"nodes":[', b"{},", b'{"mesh":0}]}', 990_000, 64 << 20)
    yield "nodes.gltf", nodes
    entries = b'{"asset":{"version":"2.0"},"accessors":[' + b'{"count":1},' * 450_000 + b'{}],"buffers":['
    yield "accessors.gltf", entries + b'{"byteLength":0,"uri":"data:;base64,"},' * 450_000 + b"{}]}"
    side, picture = 7071, Path(tempfile.gettempdir()) / "large.png"
    Image.new("RGBA", (side, side)).save(picture, compress_level=1)  # transparent everywhere
    yield "large.png", picture.read_bytes()
    picture.unlink()


def _zipped(model: bytes) -> bytes:
    with tempfile.TemporaryFile() as file:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            archive.writestr("3D/3dmodel.model", model)
        file.seek(0)
        return file.read()


def measure(path: Path) -> dict[str, object]:
    """What one process does with the file."""
    code = (
        "import sys, time\nfrom pathlib import Path\nfrom ddf.core import checks\nfrom ddf.geometry import mesh_io\n"
        "if sys.argv[1].endswith('png'):\n    from ddf.data import cutouts\n"
        "def peak():\n    status = Path('/proc/self/status').read_text()\n"
        "    return int(status.partition('VmHWM:')[2].split()[0]) >> 10\n"
        "base, began, path = peak(), time.process_time(), Path(sys.argv[1])\ntry:\n"
        "    cutouts.read(path) if path.suffix == '.png' else mesh_io.load(path)\n    said = 'read'\n"
        "except checks.InputError as fault:\n    said = str(fault).removeprefix(f'{path}: ')[:90]\n"
        "print(time.process_time() - began, peak(), peak() - base, said)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=False)
    if done.returncode:
        return {"file": path.name, "said": done.stderr.strip().splitlines()[-1][:90]}
    seconds, peak, grown, said = done.stdout.split(maxsplit=3)
    found = {"file": path.name, "mib": path.stat().st_size >> 20, "cpu_s": round(float(seconds), 1)}
    return found | {"peak_mib": int(peak), "grown_mib": int(grown), "said": said.strip()}


def main(chosen: list[str]) -> None:
    """Measure all files, or those whose names are given, and write their entries of the record."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    found = []
    with tempfile.TemporaryDirectory() as name:
        for file, data in files():
            if chosen and file not in chosen:
                continue
            path = Path(name) / file
            path.write_bytes(data)
            del data
            found.append(measure(path))
            sys.stdout.write(json.dumps(found[-1]) + "\n")
            sys.stdout.flush()
            path.unlink()
    record = json.loads(OUT.read_text(encoding="utf-8"))
    kept = {entry["file"]: entry for entry in record.get("limits", []) if chosen}
    record["limits"] = list((kept | {entry["file"]: entry for entry in found}).values())
    OUT.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
