"""Mutated mesh files into the readers: each is read, or refused in one line, without a warning, in bounded time.

    python -m tests.hard_cases.fuzz_readers 100000

Writes reports/hard_cases_readers.json: how many files, how many were read and refused, the slowest, the memory.
"""

import json
import resource
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import trimesh

from ddf.core import checks
from ddf.geometry import mesh_io

OUT = Path(__file__).resolve().parents[2] / "reports" / "hard_cases_readers.json"
_WORDS = (b"-1", b"0", b"1e999", b"nan", b"99999999999", b"\\", b"#", b"\r", b"\0", b"\xff\xfe", b"end_header", b"list")


def seeds() -> list[tuple[str, bytes]]:
    """Small whole files of every format and encoding."""
    ball = trimesh.creation.icosphere(subdivisions=1)
    mesh = mesh_io.Mesh(np.array(ball.vertices), np.array(ball.faces))
    found = [(suffix, mesh_io.export_bytes(mesh, suffix)) for suffix in mesh_io.SUFFIXES]
    polygons = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\n"
    found.append((".obj", (polygons + "f 1 2 3 4 5 6\nf -6//1 -5/2 -4 \\\n -3\n").encode()))
    rows = "0 0 0\n2 0 0\n2 1 0\n1 1 0\n1 2 0\n0 2 0\n"
    found.append((".off", ("OFF\n6 2 0\n" + rows + "6 0 1 2 3 4 5\n3 0 1 2\n").encode()))
    header = "ply\nformat {} 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
    header += "element {} 2\nproperty list uchar int vertex_indices\nend_header\n"
    found += [
        (".ply", (header.format("ascii", e) + rows + "6 0 1 2 3 4 5\n3 0 1 2\n").encode())
        for e in ("face", "tristrips")
    ]
    positions = np.array([row.split() for row in rows.splitlines()], dtype=">f4").tobytes()
    lists = b"\6" + np.arange(6, dtype=">i4").tobytes() + b"\3" + np.arange(3, dtype=">i4").tobytes()
    found.append((".ply", header.format("binary_big_endian", "face").encode() + positions + lists))
    found.append((".stl", str(ball.export(file_type="stl_ascii")).encode()))
    return found


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
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


def main(count: int) -> None:
    """Read so many files and write what happened; anything but a mesh or an InputError ends the run."""
    warnings.simplefilter("error")
    rng, files = np.random.default_rng(0), seeds()
    outcomes, slowest = {"read": 0, "refused": 0}, 0.0
    before, started = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.perf_counter()
    for i in range(count):
        suffix, data = files[i % len(files)]
        data = mutated(data, rng)
        begin = time.perf_counter()
        try:
            mesh_io.parse(data, suffix)
            outcomes["read"] += 1
        except checks.InputError as fault:
            if "\n" in str(fault):
                raise
            outcomes["refused"] += 1
        except BaseException:
            sys.stderr.write(f"file {i} ({suffix}): {data!r}\n")
            raise
        slowest = max(slowest, time.perf_counter() - begin)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    found = {"files": count, "seed_files": len(files), **outcomes, "other_errors": 0, "slowest_s": round(slowest, 3)}
    found |= {"memory_grown_mib": round(grown, 1), "took_s": round(time.perf_counter() - started, 1)}
    OUT.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
