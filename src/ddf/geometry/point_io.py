"""Point clouds as PLY files: read the vertices of any PLY, write little-endian binary ones.

Nothing is allocated for what a header claims: the bytes are counted first. Coordinates are widened to float64 and not
changed. `ddf.geometry.formats.ply` is the reader, for meshes and clouds alike.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.geometry.formats import ply, ply_header
from ddf.geometry.mesh_io import MAX_FILE_BYTES


def read_points(path: Path | str) -> Float[np.ndarray, "n 3"]:
    """Vertices of a PLY cloud or mesh, float64, in the file's order; faces, colours and normals are not read.

    Raises:
      FileNotFoundError: no such file.
      InputError: not a PLY whose vertices can be read whole, no vertices, or one that is not finite; the file is named.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file")
    if not path.is_file():
        raise checks.InputError(f"{path}: not a file; give a PLY cloud")
    checks.require_content(path)
    if path.stat().st_size > MAX_FILE_BYTES:
        raise checks.InputError(f"{path}: {path.stat().st_size} bytes; clouds must be at most {MAX_FILE_BYTES}")
    try:
        points = ply.points(path.read_bytes())
        checks.require_finite("points", points)
    except checks.InputError as fault:
        raise checks.InputError(f"{path}: {fault}") from fault
    return points


def has_faces(path: Path | str) -> bool:
    """Whether a PLY file holds a mesh, and not a cloud alone.

    Raises:
      FileNotFoundError: no such file. InputError: not a PLY file; it is named.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file")
    checks.require_content(path)
    try:
        elements = ply_header.parse(path.read_bytes()).elements
    except checks.InputError as fault:
        raise checks.InputError(f"{path}: {fault}") from fault
    return any(element.name in ("face", "tristrips") and element.count > 0 for element in elements)


def points_ply(points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"] | None = None) -> bytes:
    """A binary PLY of float32 vertices, with normals (`nx`, `ny`, `nz`) if there are."""
    columns = [points] if normals is None else [points, normals]
    names = "x y z".split() if normals is None else "x y z nx ny nz".split()
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    header += "".join(f"property float {name}\n" for name in names) + "end_header\n"
    return header.encode() + np.ascontiguousarray(np.concatenate(columns, axis=1), dtype="<f4").tobytes()
