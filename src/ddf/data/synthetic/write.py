"""One shape into the folders of ShapeNet v1 and 3D-R2N2."""

import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from ddf.core import storage
from ddf.data import shapenet
from ddf.data.synthetic import appearance, assemble, cars, chairs, palette, parts, planes, render
from ddf.data.synthetic.parts import Part

AZIMUTH_DEG = (0.0, 360.0)
ELEVATION_DEG = (25.0, 30.0)
RATIO = (0.65, 0.95)
TURN_DEG, HEIGHT_DEG = (-60.0, 60.0), (40.0, 70.0)  # of a key light
DUMMY = 25  # the last number of a metadata line, which means nothing
FACETED = 0.3  # of all shapes: shaded face by face
FACETED_COS = 1 - 1e-6  # of faces that lie in one plane, to rounding
PNG_LEVEL = 1  # fast; the files are read far more often than they are sent


def primitive(rng: np.random.Generator) -> list[Part]:
    """One ellipsoid, box, cylinder or torus."""
    paint = palette.cloth(rng)
    kind = rng.choice(["sphere", "box", "cylinder", "torus"])
    stretch = dict(zip("xyz", rng.uniform(0.6, 1.4, size=3), strict=True))
    if kind == "box":
        return [parts.box((0, 0, 0), tuple(stretch.values()), paint, name="box")]
    if kind == "torus":
        angle = np.arange(36) * (2 * np.pi / 36)
        path = np.stack([np.cos(angle), np.zeros(36), -np.sin(angle)], axis=1)
        shape = parts.tube(path, rng.uniform(0.2, 0.5), paint, sides=16, closed=True, name="torus")
    elif kind == "sphere":
        polar = np.linspace(-np.pi / 2, np.pi / 2, 17)
        profile = list(zip(np.abs(np.cos(polar)).round(12), np.sin(polar), strict=True))
        shape = parts.lathe(profile, paint, sides=28, name="sphere")
    else:
        shape = parts.lathe(parts.disc_profile(0.6, rng.uniform(0.3, 1.0)), paint, sides=32, name="cylinder")
    return [shape.scaled(**stretch)]


# Functions that design one shape of a category.
CATEGORIES: dict[str, Callable[[np.random.Generator], list[Part]]] = {
    "chair": chairs.build,
    "plane": planes.build,
    "car": cars.build,
    "primitives": primitive,
}
# Those that reach further, for training beside public shapes; other categories as above.
WIDE: dict[str, Callable[[np.random.Generator], list[Part]]] = {
    "chair": chairs.build_wide,
    "plane": planes.build_wide,
    "car": cars.build_wide,
}


def shape_id(seed: int, category: str, index: int) -> str:
    """32 hexadecimal digits from seed, category and index, so that a sorted listing mixes the styles."""
    return hashlib.sha256(f"{seed}/{category}/{index}".encode()).hexdigest()[:32]


def make_shape(seed: int, category: str, index: int, wide: bool = False) -> assemble.Shape:
    """The mesh of one synthetic shape, designed by WIDE if `wide`; the same for the same arguments."""
    design = (CATEGORIES | WIDE if wide else CATEGORIES)[category]
    rng, look = (generator(seed, category, index, purpose) for purpose in ("mesh", "look"))
    crease_cos = FACETED_COS if look.random() < FACETED else assemble.CREASE_COS
    return assemble.shape(appearance.dress(design(rng), category, look), rng, crease_cos)


def make_views(seed: int, category: str, index: int | str, count: int) -> list[render.View]:
    """Cameras drawn as in the 3D-R2N2 renders, rounded to the digits that the metadata holds."""
    rng, light = (generator(seed, category, index, purpose) for purpose in ("views", "light"))
    views = []
    for _ in range(count):
        azimuth, elevation, ratio = (
            round(float(rng.uniform(*span)), 6) for span in (AZIMUTH_DEG, ELEVATION_DEG, RATIO)
        )
        turn, height = (float(rng.uniform(*span)) for span in (TURN_DEG, HEIGHT_DEG))
        views.append(render.View(azimuth, elevation, ratio, render.draw_light(light, turn, height)))
    return views


def write_shape(root: Path, seed: int, category: str, index: int, num_views: int, wide: bool = False) -> list[Path]:
    """Write mesh, renders and metadata of one synthetic shape under `root`; returns all files, renderings.txt last."""
    views, shape = make_views(seed, category, index, num_views), make_shape(seed, category, index, wide)
    return write_files(root, category, shape_id(seed, category, index), shape, views)


def write_files(
    root: Path, category: str, name: str, shape: assemble.Shape, views: Sequence[render.View]
) -> list[Path]:
    """Write mesh, renders and metadata of any shape; files as of `write_shape`."""
    synset = shapenet.synset(category)
    files = [shapenet.model_path(root, synset, name)]
    images = shapenet.rendering_dir(root, synset, name)
    for folder in (files[0].parent, images):
        folder.mkdir(parents=True, exist_ok=True)
    with storage.naming(files[0]):
        files[0].write_text(obj_text(shape))
    renderer = render.Renderer(shape)
    for number, view in enumerate(views):
        files.append(images / f"{number:02d}.png")
        with storage.naming(files[-1]):
            Image.fromarray(renderer.render(view)).save(files[-1], compress_level=PNG_LEVEL)
    lines = [f"{view.azimuth_deg:.6f} {view.elevation_deg:.6f} 0 {view.ratio:.6f} {DUMMY}\n" for view in views]
    listing = [f"{path.name}\n" for path in files[1:]]
    for path, text in ((images / "rendering_metadata.txt", lines), (images / "renderings.txt", listing)):
        with storage.naming(path):
            path.write_text("".join(text))
        files.append(path)
    return files


def obj_text(shape: assemble.Shape) -> str:
    """The mesh as OBJ text: vertices, then triangles by part."""
    lines = [f"v {x:.8f} {y:.8f} {z:.8f}" for x, y, z in shape.vertices.tolist()]
    faces = [f"f {a} {b} {c}" for a, b, c in (shape.triangles + 1).tolist()]
    start = 0
    for name, count in shape.parts:
        lines += [f"g {name}", *faces[start : start + count]]
        start += count
    return "\n".join(lines) + "\n"


def generator(seed: int, category: str, index: int | str, purpose: str) -> np.random.Generator:
    """An independent stream per shape and purpose."""
    digest = hashlib.sha256(f"{seed}/{category}/{index}/{purpose}".encode()).digest()
    return np.random.default_rng(int.from_bytes(digest[:16], "little"))
