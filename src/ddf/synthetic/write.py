"""One synthetic shape into the folders of ShapeNet v1 and 3D-R2N2."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from ddf.synthetic import assemble, cars, chairs, planes, primitives, render
from ddf.synthetic.parts import Part

AZIMUTH_DEG = (0.0, 360.0)
ELEVATION_DEG = (25.0, 30.0)
RATIO = (0.65, 0.95)
DUMMY = 25  # the last number of a metadata line, which means nothing
PNG_LEVEL = 1  # fast; the files are read far more often than they are sent


@dataclass(frozen=True)
class Category:
    """A synthetic category: its folder name and the function that designs a shape."""

    synset: str
    build: Callable[[np.random.Generator], list[Part]]


CATEGORIES = {
    "chair": Category("03001627", chairs.build),
    "plane": Category("02691156", planes.build),
    "car": Category("02958343", cars.build),
    "primitives": Category("00000001", primitives.build),  # made up: WordNet has no such synset
}


def shape_id(seed: int, category: str, index: int) -> str:
    """32 hexadecimal digits from seed, category and index, so that a sorted listing mixes the styles."""
    return hashlib.sha256(f"{seed}/{category}/{index}".encode()).hexdigest()[:32]


def make_shape(seed: int, category: str, index: int) -> assemble.Shape:
    """The mesh of one synthetic shape; the same for the same arguments."""
    rng = _generator(seed, category, index, "mesh")
    return assemble.shape(CATEGORIES[category].build(rng), rng)


def make_views(seed: int, category: str, index: int, count: int) -> list[render.View]:
    """Cameras drawn as in the 3D-R2N2 renders, rounded to the digits that the metadata holds."""
    rng = _generator(seed, category, index, "views")
    views = []
    for _ in range(count):
        azimuth, elevation, ratio = (round(float(rng.uniform(*span)), 6) for span in (AZIMUTH_DEG, ELEVATION_DEG, RATIO))
        views.append(render.View(azimuth, elevation, ratio, rng.uniform(-60, 60), rng.uniform(40, 70)))
    return views


def write_shape(root: Path, seed: int, category: str, index: int, num_views: int) -> str:
    """Write mesh, renders and metadata of one shape under `root`; returns its id."""
    name, synset = shape_id(seed, category, index), CATEGORIES[category].synset
    shape = make_shape(seed, category, index)
    model = root / "ShapeNetCore.v1" / synset / name
    images = root / "ShapeNetRendering" / synset / name / "rendering"
    for folder in (model, images):
        folder.mkdir(parents=True, exist_ok=True)
    (model / "model.obj").write_text(obj_text(shape))
    views = make_views(seed, category, index, num_views)
    renderer = render.Renderer(shape)
    for number, view in enumerate(views):
        Image.fromarray(renderer.render(view), "RGBA").save(images / f"{number:02d}.png", compress_level=PNG_LEVEL)
    lines = [f"{view.azimuth_deg:.6f} {view.elevation_deg:.6f} 0 {view.ratio:.6f} {DUMMY}\n" for view in views]
    (images / "rendering_metadata.txt").write_text("".join(lines))
    (images / "renderings.txt").write_text("".join(f"{number:02d}.png\n" for number in range(num_views)))
    return name


def obj_text(shape: assemble.Shape) -> str:
    """The mesh as OBJ text: vertices, then triangles by part."""
    lines = [f"v {x:.8f} {y:.8f} {z:.8f}" for x, y, z in shape.vertices.tolist()]
    faces = [f"f {a} {b} {c}" for a, b, c in (shape.triangles + 1).tolist()]
    start = 0
    for name, count in shape.parts:
        lines += [f"g {name}", *faces[start : start + count]]
        start += count
    return "\n".join(lines) + "\n"


def _generator(seed: int, category: str, index: int, purpose: str) -> np.random.Generator:
    """An independent stream per shape and purpose."""
    digest = hashlib.sha256(f"{seed}/{category}/{index}/{purpose}".encode()).digest()
    return np.random.default_rng(int.from_bytes(digest[:16], "little"))
