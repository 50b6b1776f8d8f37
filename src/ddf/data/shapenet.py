"""The folders of ShapeNet v1 with 3D-R2N2 renders: names, listings, cameras, images, and the index of a data set.

    <root>/ShapeNetCore.v1/<synset>/<id>/model.obj
    <root>/ShapeNetRendering/<synset>/<id>/rendering/{00..23.png, rendering_metadata.txt, renderings.txt}

Real data and our generator's are read by the same code. Every complaint names the file and what to do.
"""

import logging
import math
import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from PIL import Image
from torch import Tensor

from ddf.core import checks, storage
from ddf.geometry import cameras

MODELS, RENDERS = "ShapeNetCore.v1", "ShapeNetRendering"  # folders of a root
METADATA = "rendering_metadata.txt"  # of the renders of a shape
SYNSETS = {
    "plane": "02691156",
    "bed": "02818832",
    "bench": "02828884",
    "cabinet": "02933112",
    "car": "02958343",
    "chair": "03001627",
    "monitor": "03211117",
    "lamp": "03636649",
    "speaker": "03691459",
    "rifle": "04090263",
    "sofa": "04256520",
    "table": "04379243",
    "phone": "04401088",
    "vessel": "04530566",
    "primitives": "00000001",  # made up, for the synthetic smoke set: WordNet has no such offset
}

LOGGER = logging.getLogger(__name__)
# What Pillow raises on damaged files.
DAMAGED = (OSError, SyntaxError, ValueError, struct.error, KeyError, MemoryError, Image.DecompressionBombError)
_JUNK = re.compile(r"\..*|__MACOSX|@eaDir|#recycle|lost\+found|\$RECYCLE\.BIN|System Volume Information")
_SYNSET = re.compile(r"[0-9]+")
_NAME = re.compile(r"[A-Za-z0-9_-]+")  # every synset and id of ShapeNet v1 fits; nothing that leaves its folder does


def synset(category: str) -> str:
    """The class of a category; one that ShapeNet has not is its own."""
    return SYNSETS.get(category, category)


def check_name(name: object, where: str) -> str:
    """`name` if it is a plain folder name; InputError, beginning with `where`, if it could lead out of its folder."""
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise checks.InputError(f"{where}: a synset or shape id must have letters, digits, - and _ only; got {name!r}")
    return name


def model_path(root: Path, synset: str, shape_id: str) -> Path:
    """The mesh of a shape."""
    names = check_name(synset, str(root)), check_name(shape_id, str(root))
    return root / MODELS / names[0] / names[1] / "model.obj"


def rendering_dir(root: Path, synset: str, shape_id: str) -> Path:
    """The folder with the renders of a shape."""
    names = check_name(synset, str(root)), check_name(shape_id, str(root))
    return root / RENDERS / names[0] / names[1] / "rendering"


def image_path(root: Path, synset: str, shape_id: str, view: int) -> Path:
    """One render of a shape."""
    return rendering_dir(root, synset, shape_id) / f"{view:02d}.png"


def list_shapes(root: Path, synset: str) -> list[str]:
    """Ids of all shapes of a class that have a folder of renders, sorted as strings."""
    folder = _renders(root) / check_name(synset, str(root))
    if not folder.is_dir():
        raise checks.InputError(f"{folder}: no such folder; unpack the 3D-R2N2 renders of class {synset} there")
    ids = _folders(folder)
    for part in (RENDERS, MODELS):
        require_flat(root / part / synset)
    if not ids:
        raise checks.InputError(f"{folder}: has no shapes; unpack the 3D-R2N2 renders of class {synset} there")
    return [check_name(name, str(folder)) for name in ids]


def list_classes(root: Path) -> list[str]:
    """Synsets of all classes that have renders, sorted; InputError where there are none, or any other folder."""
    folder = _renders(root)
    synsets = _folders(folder)
    unknown = [name for name in synsets if not _SYNSET.fullmatch(name)]
    if unknown:
        raise checks.InputError(f"{folder / unknown[0]}: not a synset (digits only); move it out of {folder.name}")
    if not synsets:
        raise checks.InputError(f"{folder}: has no classes; unpack the 3D-R2N2 renders there (ShapeNetRendering.tgz)")
    return synsets


def _folders(folder: Path) -> list[str]:
    """Names of the folders in a folder, sorted, without those that file managers, archives and notebooks leave."""
    names = sorted(entry.name for entry in folder.iterdir() if entry.is_dir())
    junk = [name for name in names if _JUNK.fullmatch(name)]
    if junk:
        LOGGER.warning("%s: passed over %s", folder, ", ".join(junk))
    return [name for name in names if name not in junk]


def _renders(root: Path) -> Path:
    """The folder of all renders; InputError says what is missing."""
    if not root.is_dir():
        raise checks.InputError(
            f"{root}: no such folder; give the root that holds ShapeNetCore.v1/ and ShapeNetRendering/, as in "
            "`make reproduce-table CONFIG=configs/paper.yaml DATA=/path/to/shapenet`"
        )
    folder = root / RENDERS
    if not folder.is_dir():
        raise checks.InputError(f"{folder}: no such folder; unpack the 3D-R2N2 renders there (ShapeNetRendering.tgz)")
    require_flat(folder)
    return folder


def require_flat(folder: Path) -> None:
    """Raise if a folder holds one of its own name, as archives do that were unpacked into their own folder."""
    inner = folder / folder.name
    if inner.is_dir():
        raise checks.InputError(f"{inner}: nested twice; move what it holds one folder up")


def read_cameras(folder: Path) -> Float[np.ndarray, "views 3"]:
    """Azimuth and elevation in degrees and ratio in benchmark units, one row per view, from a shape's metadata file;
    InputError names file and line.
    """
    path = folder / METADATA
    if not path.is_file():
        raise checks.InputError(f"{path}: no such file; unpack the renders of this shape again")
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except UnicodeDecodeError as error:
        raise checks.InputError(f"{path}: not a text file; unpack the renders of this shape again") from error
    while lines and not lines[-1].strip():
        lines.pop()
    return np.array([_camera(line, f"{path}:{i}") for i, line in enumerate(lines, 1)]).reshape(-1, 3)


def _camera(line: str, where: str) -> tuple[float, float, float]:
    try:
        azimuth, elevation, _, ratio, _ = values = [float(word) for word in line.split()]
    except ValueError as fault:
        raise checks.InputError(
            f"{where}: must be 'azimuth elevation 0 ratio 25', five numbers; got {line!r}"
        ) from fault
    if not (all(map(math.isfinite, values)) and abs(elevation) <= 90 and ratio > 0):
        raise checks.InputError(f"{where}: elevation must be in [-90, 90] and ratio > 0, all finite; got {line!r}")
    return azimuth, elevation, ratio


def read_image(path: Path, size: int) -> Float[Tensor, "4 size size"]:
    """A render in [0, 1], RGBA, resized with antialiasing (weighted by alpha); RGB is 0 where alpha is 0."""
    if not path.is_file():
        raise checks.InputError(f"{path}: no such image; unpack the renders of this shape again (00.png to 23.png)")
    try:
        with Image.open(path) as image:
            _check_image(image, path)
            image.load()
            pixels = np.array(image if size == image.width else image.resize((size, size), Image.Resampling.BILINEAR))
    except checks.InputError:
        raise
    except DAMAGED as error:
        raise checks.InputError(f"{path}: not a readable PNG ({error}); unpack this shape's renders again") from error
    pixels[pixels[..., 3] == 0] = 0
    return torch.from_numpy(pixels).permute(2, 0, 1).float() / 255


def _check_image(image: Image.Image, path: Path) -> None:
    if image.size != (cameras.IMAGE_SIZE, cameras.IMAGE_SIZE):
        raise checks.InputError(
            f"{path}: must be {cameras.IMAGE_SIZE} x {cameras.IMAGE_SIZE} pixels, as the camera model is; got "
            f"{image.width} x {image.height}"
        )
    if image.mode != "RGBA":
        raise checks.InputError(
            f"{path}: must be RGBA, its alpha is the mask of the shape; got {image.mode}; use the original renders"
        )


@dataclass(frozen=True)
class ShapeEntry:
    """A shape of a data set, with its views on either side of the split; those of a shape held out of training for
    choices are its validation views.
    """

    id: str
    train_views: tuple[int, ...]
    test_views: tuple[int, ...]
    validation_views: tuple[int, ...] = ()


@dataclass(frozen=True)
class CategoryEntry:
    """A category of a data set: its class, and its shapes in the order of the split."""

    synset: str
    shapes: tuple[ShapeEntry, ...]


@dataclass(frozen=True)
class Dataset:
    """A data root with the index that the stage `dataset` wrote.

    root: as in the index: relative to the folder that stages run in (the repository root), or absolute.
    """

    root: Path
    categories: Mapping[str, CategoryEntry]

    @classmethod
    def open(cls, index_path: str | Path) -> "Dataset":
        """Read index.json; InputError names the file when it is not one."""
        index = storage.read_json(index_path)
        try:
            categories = {name: _category_entry(entry, str(index_path)) for name, entry in index["categories"].items()}
            return cls(Path(index["root"]), categories)
        except (KeyError, TypeError, AttributeError) as error:
            raise checks.InputError(f"{index_path}: not the index of a data set ({error}); run its stage") from error

    def category(self, name: str) -> CategoryEntry:
        """A category by name; InputError lists those that there are."""
        if name not in self.categories:
            raise checks.InputError(f"category {name!r} is not in the data set; it has {', '.join(self.categories)}")
        return self.categories[name]

    def views(self, category: str, side: str) -> list[tuple[str, tuple[int, ...]]]:
        """Ids of the category's shapes with their views on a side (train, test, validation), in order."""
        found = ((shape.id, getattr(shape, f"{side}_views")) for shape in self.category(category).shapes)
        return [(name, views) for name, views in found if views]

    def model(self, category: str, shape_id: str) -> Path:
        """The mesh file of a shape."""
        return model_path(self.root, self.category(category).synset, shape_id)

    def cameras(self, category: str, shape_id: str) -> Float[np.ndarray, "views 3"]:
        """Azimuth and elevation in degrees and ratio of all views of a shape."""
        return read_cameras(rendering_dir(self.root, self.category(category).synset, shape_id))

    def image(self, category: str, shape_id: str, view: int, size: int) -> Float[Tensor, "4 size size"]:
        """One render of a shape; see `read_image`."""
        return read_image(image_path(self.root, self.category(category).synset, shape_id, view), size)


def _category_entry(entry: dict, where: str) -> CategoryEntry:
    shapes = tuple(
        ShapeEntry(
            check_name(shape["id"], where),
            tuple(shape["train_views"]),
            tuple(shape["test_views"]),
            tuple(shape.get("validation_views", ())),
        )
        for shape in entry["shapes"]
    )
    return CategoryEntry(check_name(entry["synset"], where), shapes)
