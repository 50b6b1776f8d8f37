"""Files near the size limit whose last line is at fault: seconds of one core and memory until they are refused.

    python tests/hard_cases/size_limits.py 1.0

The argument is the share of the limit that the files have. One process a file; a table on standard output.
"""

import json
import resource
import struct
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path

import numpy as np
from PIL import Image

LIMIT = 512 << 20
BEYOND = 1 << 30  # bytes of memory, and seconds, that a refusal may take
_HEADER = (
    "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\n"
)
_HEADER += "property list uchar int vertex_indices\nend_header\n"


def _repeated(path: Path, head: bytes, row: bytes, tail: bytes, size: int) -> None:
    block = row * max(1, (1 << 20) // len(row))
    with path.open("wb") as file:
        file.write(head)
        while file.tell() + len(block) + len(tail) <= size:
            file.write(block)
        file.write(tail)


def make(folder: Path, size: int) -> list[Path]:
    """The files, each of about `size` bytes."""
    obj, faces, quads = folder / "vertices.obj", folder / "faces.obj", folder / "quads.obj"
    _repeated(obj, b"", b"v 0.123456 -0.654321 0.111111\n", b"v 0 x 0\n", size)
    _repeated(faces, b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", b"f 1 2 3\n", b"f 1 2 9\n", size)
    _repeated(quads, b"v 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 0.5 0\n", b"f 1 2 3 4\n", b"f 1 2 9\n", size)
    row, rows = b"0.123456 -0.654321 0.111111\n", size // 28
    off, ply = folder / "rows.off", folder / "rows.ply"
    _repeated(off, f"OFF\n{rows} 0 0\n".encode(), row, b"", size)
    _repeated(ply, _HEADER.format("ascii", rows, 0).encode(), row, b"", size)
    binary = folder / "rows_binary.ply"
    _repeated(
        binary,
        _HEADER.format("binary_little_endian", 3, (size - 400) // 13).encode() + bytes(36),
        struct.pack("<B3i", 3, 0, 1, 9),
        b"",
        size,
    )
    text, stl = folder / "text.stl", folder / "counts.stl"
    facet = b"facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
    _repeated(text, b"solid a\n", facet, b"", size)
    _repeated(stl, bytes(80) + struct.pack("<I", size // 50 + 9), bytes(50), b"", size)
    return [obj, faces, quads, off, ply, binary, text, stl, *_scenes(folder, size)]


def _scenes(folder: Path, size: int) -> list[Path]:
    dae, threemf, picture = folder / "numbers.dae", folder / "vertices.3mf", folder / "large.png"
    _repeated(dae, b"<COLLADA><float_array>", b"0.123456 -0.654321 0.111111 ", b"", size)
    core = b'<model xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources><object id="1"><mesh>'
    part = folder / "part"
    _repeated(part, core + b"<vertices>", b'<vertex x="0.123456" y="-0.654321" z="0.111111"/>', b"", size)
    with zipfile.ZipFile(threemf, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.write(part, "3D/3dmodel.model")
    part.unlink()
    side = int(np.sqrt(50e6 * size / LIMIT))
    Image.new("RGBA", (side, side)).save(picture, compress_level=1)  # transparent everywhere
    return [dae, threemf, picture]


def measure(path: Path) -> dict[str, object]:
    """What one process does with the file."""
    code = (
        "import sys, resource\nfrom pathlib import Path\nfrom ddf.core import checks\nfrom ddf.data import shapenet\n"
        "from ddf.geometry import mesh_io\nbase = resource.getrusage(resource.RUSAGE_SELF)\n"
        "path = Path(sys.argv[1])\ntry:\n"
        "    shapenet.read_any_image(path, 64) if path.suffix == '.png' else mesh_io.load(path)\n    said = 'read'\n"
        "except checks.InputError as fault:\n    said = str(fault).removeprefix(f'{path}: ')[:90]\n"
        "end = resource.getrusage(resource.RUSAGE_SELF)\n"
        "print(end.ru_utime + end.ru_stime - base.ru_utime - base.ru_stime, end.ru_maxrss, base.ru_maxrss, said)\n"
    )
    began = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=False)
    if done.returncode:
        return {"file": path.name, "said": done.stderr.strip().splitlines()[-1][:90]}
    seconds, peak, base, said = done.stdout.split(maxsplit=3)
    found = {"file": path.name, "mib": path.stat().st_size >> 20, "cpu_s": round(float(seconds), 1)}
    found |= {"wall_s": round(time.perf_counter() - began, 1), "peak_mib": int(peak) >> 10}
    return found | {"grown_mib": (int(peak) - int(base)) >> 10, "said": said.strip()}


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with tempfile.TemporaryDirectory() as name:
        for each in make(Path(name), int(LIMIT * float(sys.argv[1] if len(sys.argv) > 1 else 1))):
            sys.stdout.write(json.dumps(measure(each)) + "\n")
            sys.stdout.flush()
            each.unlink()
