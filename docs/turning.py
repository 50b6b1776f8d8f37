"""Writes docs/turning.webp, the first picture of README.md: fields fitted in seconds, turning under a lamp.

Its metadata hold the checksum of the meshes that they are fitted to.
"""

import hashlib
import io
import json
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageSequence

from ddf import cli
from ddf.data.synthetic import showcase
from ddf.geometry import mesh_io

SHAPES = ("rabbit", "armchair", "airliner")
SIZE, FRAMES, FRAME_MS = 280, 36, 80
OUT = Path(__file__).with_suffix(".webp")


def checksum() -> str:
    """Of the meshes."""
    digest = hashlib.sha256()
    for name in SHAPES:
        mesh = showcase.SHAPES[name]()
        digest.update(mesh.vertices.astype("<f4").tobytes())
        digest.update(mesh.faces.astype("<i4").tobytes())
    return digest.hexdigest()


def main() -> None:
    """One row."""
    columns = []
    with tempfile.TemporaryDirectory() as folder:
        for name in SHAPES:
            mesh, field, turn = (Path(folder) / each for each in (f"{name}.ply", name, f"{name}.webp"))
            mesh.write_bytes(mesh_io.ply_bytes(showcase.SHAPES[name]()))
            for words in (["fit", mesh, field], ["render", field, turn, "--turn", FRAMES, "--size", SIZE, "--ao", 24]):
                if cli.main([str(word) for word in words]):
                    raise SystemExit(1)
            columns.append([np.array(frame.convert("RGB")) for frame in ImageSequence.Iterator(Image.open(turn))])
    first, *others = (Image.fromarray(np.concatenate(row, 1)) for row in zip(*columns, strict=True))
    buffer = io.BytesIO()
    first.save(
        buffer,
        "WEBP",
        save_all=True,
        append_images=others,
        duration=FRAME_MS,
        loop=0,
        quality=70,
        method=6,
        xmp=json.dumps({"meshes": checksum()}).encode(),
    )
    OUT.write_bytes(buffer.getvalue())


if __name__ == "__main__":
    main()
