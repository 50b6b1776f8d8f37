"""Text that is read in blocks, many numbers at once: the same numbers as Python's, wherever a block ends."""

import numpy as np
import pytest

from ddf.core import checks
from ddf.geometry import mesh_io
from ddf.geometry.formats import text

_FORMS = (repr, "{:.6f}".format, "{:.3e}".format, "{:+.17g}".format)
_CORNERS = ("{}", "{}/7", "{}//-3", "{}/1/2")
_OTHERS = ("vn 0 0 1", "vt 0 1", "# v 1 2 3", "g a b", "s 1", "", "usemtl wood", "l 1 2", "g x \\\n y", "  # f 1 2 3")


ARROW = b"v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\nf 5 1 2 3 4\n"


@pytest.fixture
def _small_blocks(monkeypatch):
    monkeypatch.setattr(text, "_BLOCK", 512)


def _content(seed):
    """Words of vertices, their values, and triangles."""
    rng = np.random.default_rng(seed)
    words = [[_FORMS[rng.integers(0, 4)](float(x)) for x in row] for row in rng.normal(size=(120, 3))]
    return words, np.array(words, dtype=np.float64), rng.integers(0, 120, (150, 3)), rng


@pytest.mark.usefixtures("_small_blocks")
@pytest.mark.parametrize("seed", range(4))
def test_obj_of_mixed_lines_is_read_in_order(seed):
    words, vertices, faces, rng = _content(seed)
    lines, placed, faced = [], 0, 0
    while placed < len(words) or faced < len(faces):
        kind = rng.integers(0, 3)
        if kind == 0 and placed < len(words):
            colours = " 0.1 0.2 0.3" * int(rng.integers(0, 2))
            lines.append("\t " * (seed % 2) + "v " + "  ".join(words[placed]) + colours)
            placed += 1
        elif kind == 1 and faced < len(faces):
            index = [int(i) - placed if i < placed and rng.integers(0, 2) else int(i) + 1 for i in faces[faced]]
            lines.append("f " + " ".join(_CORNERS[rng.integers(0, 4)].format(i) for i in index))
            faced += 1
        elif kind == 2:
            lines.append(_OTHERS[rng.integers(0, len(_OTHERS))])
    mesh = mesh_io.parse(("\r\n" if seed == 3 else "\n").join(lines).encode(), ".obj")
    np.testing.assert_array_equal(mesh.vertices, vertices)
    np.testing.assert_array_equal(mesh.faces, faces)


@pytest.mark.usefixtures("_small_blocks")
@pytest.mark.parametrize("end", ["", "\n", "\n \n\n"])
@pytest.mark.parametrize("more", ["", " 7 8 9"])
@pytest.mark.parametrize("gap", ["\n", "\n\n"])
def test_rows_of_off_and_ply_are_read_in_order(end, more, gap):
    words, vertices, faces, _ = _content(9)
    rows = gap.join([*(" ".join(row) + more for row in words), *(f"3 {a} {b} {c}{more}" for a, b, c in faces)]) + end
    extra = "".join(f"property uchar {name}\n" for name in "rgb") if more else ""
    header = "ply\nformat ascii 1.0\nelement vertex 120\n" + "".join(f"property double {axis}\n" for axis in "xyz")
    header += f"{extra}element face 150\nproperty list uchar int vertex_indices\n{extra}end_header\n"
    for data, suffix in ((f"OFF\n120 150 0\n{rows}", ".off"), (header + rows, ".ply")):
        mesh = mesh_io.parse(data.encode(), suffix)
        np.testing.assert_array_equal(mesh.vertices, vertices)
        np.testing.assert_array_equal(mesh.faces, faces)
        with pytest.raises(checks.InputError, match="rows follow"):
            mesh_io.parse(f"{data.rstrip()}\n3 0 1 2".encode(), suffix)


@pytest.mark.parametrize("block", [512, 1 << 16])
@pytest.mark.parametrize("every", [3, 60, 1000])
def test_facets_of_one_or_many_solids_are_read_in_order(monkeypatch, block, every):
    monkeypatch.setattr(text, "_BLOCK", block)
    words, vertices, faces, _ = _content(5)
    lines = ["solid facet a"]
    for i, face in enumerate(faces):
        lines += ["facet normal 0 0 1", " outer loop", *(" vertex " + " ".join(words[k]) for k in face)]
        lines += [" endloop", "endfacet", *(["endsolid", "", "Solid b"] if i % every == every - 1 else [])]
    mesh = mesh_io.parse("\n".join([*lines, "endsolid"]).encode(), ".stl")
    np.testing.assert_array_equal(mesh.vertices, vertices[faces].reshape(-1, 3))


@pytest.mark.usefixtures("_small_blocks")
@pytest.mark.parametrize("line", ["v 1 2 x", "v 1 2", "f 1 /2 3", "f 1 0 2", "f 1 -9999 2", "f 1 2.0 3", "v1 2 3 4"])
def test_a_fault_is_named_by_its_line_in_any_block(line):
    good = "v 0.5 0 1\n" * 200
    with pytest.raises(checks.InputError, match=r"line 201\b"):
        mesh_io.parse(f"{good}{line}\n{good}".encode(), ".obj")


def test_numbers_at_once_are_those_of_python_or_none():
    blocks = text.Blocks(b"")
    rng = np.random.default_rng(3)
    bits = rng.integers(0, 1 << 64, 3000, dtype=np.uint64).view(np.float64)
    words = [repr(float(x)) for x in bits[np.isfinite(bits)]]
    table = blocks.table(" ".join(words).encode())
    assert table is not None and table.values.tolist() == [float(word) for word in words]
    for odd in (b"1 2-3", b"1e 2", b"0x1 2", b"1_0", b"1 - 2", b"1..2", b"1 2 3-4 --5", b"nan 1"):
        assert blocks.table(odd) is None, odd
    assert blocks.table(b"1.0 2", whole=True) is None
    found = blocks.table(b"1 -2\n\n +3\n", whole=True)
    assert found is not None and found.values.tolist() == [1, -2, 3] and found.counts.tolist() == [2, 0, 1]


@pytest.mark.parametrize(
    ("name", "value", "data", "suffix", "words"),
    [
        ("text.MAX_LINES", 8, b"v 0 0 0\n" * 9, ".obj", "9 lines; at most 8"),
        ("obj.MAX_FACES", 1, b"v 0 0 0\n" * 3 + b"f 1 2 3\n" * 2, ".obj", "2 faces; at most 1"),
        ("text.MAX_NUMBERS", 10, b"v 0 0 0\n" * 9, ".obj", "more than 10 numbers"),
        ("text.MAX_BY_WORD", 10, b"V 0 0 0\n" * 9, ".obj", "unusual form"),
        ("text.MAX_CONTINUED", 10, b"# \\\n" * 9, ".obj", "lines that end in backslashes"),
        ("raw.MAX_VERTICES", 8, b"v 0 0 0\n" * 9, ".obj", "9 vertices; at most 8"),
        ("raw.MAX_CORNERS", 8, b"v 0 0 0\n" * 9 + b"f 1 2 3 4 5 6 7 8 9\n", ".obj", "9 corners; at most 8"),
        ("polygons._WORK", 8, ARROW, ".obj", "concave polygons"),
        ("scenes.MAX_MARKS", 9, b"<COLLADA>\n\n\n\n\n\n\n\n</COLLADA>", ".dae", "elements and line ends"),
        ("scenes.MAX_ATTRIBUTES", 1, b'<COLLADA a="" b=""', ".dae", "too many attributes"),
        ("collada._ELEMENTS", 1, b"<COLLADA><a/></COLLADA>", ".dae", "more than 1 elements and attributes"),
        ("gltf.MAX_BRACKETS", 3, b"[[],[],[]]", ".gltf", "more than 3 lists and objects"),
        ("gltf.MAX_COMMAS", 3, b"[1,2,3,4,5]", ".gltf", "more than 3 entries"),
    ],
)
def test_what_would_take_long_is_refused(monkeypatch, name, value, data, suffix, words):
    monkeypatch.setattr(f"ddf.geometry.formats.{name}", value)
    monkeypatch.setattr(text, "_BLOCK", 16)
    with pytest.raises(checks.InputError, match=words):
        mesh_io.parse(data, suffix)
