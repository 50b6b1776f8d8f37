"""Geomview OFF: header with counts, a row per vertex, a row per polygon, read as those of a PLY file in text.

Our own reader: trimesh refuses faces of several sizes and reads files that are cut short; Open3D reads no other header.
"""

import re

from ddf.core import checks
from ddf.geometry.formats import ply, raw, text

_HEADER = re.compile(rb"(ST)?(C)?(N)?(4)?(n)?OFF(.*)", re.IGNORECASE | re.DOTALL)
_HEADER_LINES = 100_000  # blank ones among them
_MAX_COMMENTS = 1_000_000
_COMMENT = re.compile(rb"#[^\r\n]*")


def parse(data: bytes) -> raw.Raw:
    """Vertices and triangles of an OFF file; colours, normals and texture coordinates are not read."""
    data = text.decoded(data)
    if data.count(b"#") > _MAX_COMMENTS:
        raise checks.InputError(f"more than {_MAX_COMMENTS} comments; save it without")
    blocks = text.Blocks(_COMMENT.sub(b"", data))
    num_vertices, num_faces = _counts(blocks, len(data))
    axes = [ply.Property(axis, "f8") for axis in "xyz"]
    corners = ply.Property("vertex_indices", "i8", "i8")
    rows = [ply.Element("vertex", num_vertices, axes), ply.Element("face", num_faces, [corners])]
    found = ply.from_text(blocks, rows, {"vertex": "xyz", "face": ["vertex_indices"]}, spare=True)
    return raw.of_polygons(ply.positions(found), *ply.lists(found, "face"))


def _next_words(blocks: text.Blocks) -> list[bytes]:
    """The words of the next line that has some; none at the end."""
    for _ in range(_HEADER_LINES):
        block = blocks.next(1)
        if block is None:
            break
        if words := block.data.split():
            return words
    return []


def _counts(blocks: text.Blocks, size: int) -> tuple[int, int]:
    """Vertices and faces, from the header's line (glued to the keyword or not) or the one after it."""
    first, *words = _next_words(blocks) or [b""]
    match = _HEADER.fullmatch(first)
    if not match:
        raise checks.InputError("not an off mesh: no OFF header with counts")
    if match[4] or match[5]:
        raise checks.InputError(f"{text.shown(first)}: vertices with four or n coordinates are not read")
    if words and words[0].upper() == b"BINARY":
        raise checks.InputError("binary OFF is not read; save it as text")
    words = [match[6], *words] if match[6] else words
    words = words or _next_words(blocks)
    if not 2 <= len(words) <= 3 or not all(word.isdigit() and len(word) < 20 for word in words):
        raise checks.InputError("not an off mesh: no OFF header with counts")
    num_vertices, num_faces = int(words[0]), int(words[1])
    raw.require_room("vertices", num_vertices, 6, size)
    raw.require_room("faces", num_faces, 2, size)
    return num_vertices, num_faces
