"""The mesh that the stages on single shapes fit: a file, or a procedural chair where none is named."""

from pathlib import Path

from ddf.core import seeding, storage
from ddf.data.synthetic import assemble, chairs
from ddf.geometry import mesh_io


def read(path: str | None, seed: int) -> tuple[mesh_io.Mesh, dict[str, str]]:
    """The mesh in its own frame, and name to checksum of its file; a chair that the seed decides, and {}, for None.

    Raises:
      FileNotFoundError: there is no such file. InputError: it holds no mesh.
    """
    if path is None:
        random = seeding.generator(seed, "fit_shape")
        shape = assemble.shape(chairs.build(random), random)
        return mesh_io.Mesh(shape.vertices, shape.triangles), {}
    file = Path(path)
    return mesh_io.load(file), {file.name: storage.checksum(file)}
