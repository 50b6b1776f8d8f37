"""The Pixel2Mesh split of ShapeNet into train and test views, from nothing but a listing of shape ids.

Per class: all ids, without the broken car, sorted naturally; each id gives views 00 to 04; of these lines the first
80 % train and the rest test. So one shape per class can have views on both sides ("straddling"); strict splits train on
all of them. On the listing of the 3D-R2N2 renders the lines equal the published lists byte for byte.
"""

import hashlib
import re
from collections.abc import Iterable, Mapping, Sequence

from ddf.core import checks
from ddf.data import shapenet

VIEWS = (0, 1, 2, 3, 4)
CLASS_ORDER = (
    "04256520", "02933112", "02828884", "03001627", "03211117", "04090263", "03691459",
    "03636649", "04401088", "02691156", "04379243", "02958343", "04530566",
)  # fmt: skip
BROKEN = frozenset({("02958343", "f9c1d7748c15499c6f2bd1c4e9adb41")})


def natural_key(name: str) -> tuple:
    """Sort key: runs of digits as integers, other characters one by one (digits first); ties by the plain string."""
    pieces = re.findall(r"[0-9]+|[^0-9]", name)
    return tuple((0, int(piece), "") if piece.isdecimal() else (1, 0, piece) for piece in pieces), name


def split_class(synset: str, ids: Iterable[str], *, strict: bool = False) -> list[shapenet.ShapeEntry]:
    """The split of one class, in its order, from folder names in any order; `strict` puts a straddling shape whole into
    train. InputError where an id is repeated, or no plain folder name.
    """
    listed = [shapenet.check_name(name, f"class {synset}") for name in ids]
    if len(set(listed)) < len(listed):
        twice = next(name for name in listed if listed.count(name) > 1)
        raise checks.InputError(f"class {synset}: shape {twice} is listed twice; list every shape once")
    ordered = sorted((name for name in listed if (synset, name) not in BROKEN), key=natural_key)
    num_train = len(VIEWS) * len(ordered) * 4 // 5
    shapes = []
    for place, name in enumerate(ordered):
        cut = min(max(num_train - place * len(VIEWS), 0), len(VIEWS))
        if strict and cut:
            cut = len(VIEWS)
        shapes.append(shapenet.ShapeEntry(name, VIEWS[:cut], VIEWS[cut:]))
    return shapes


def held_out(shapes: Sequence[shapenet.ShapeEntry], share: float) -> set[str]:
    """Ids of the last shapes of a class that train alone, as many as this share of them, rounded: for validation."""
    alone = [shape.id for shape in shapes if not shape.test_views]
    count = round(share * len(alone))
    return set(alone[len(alone) - count :])


def split(listing: Mapping[str, Sequence[str]], *, strict: bool = False) -> dict[str, list[shapenet.ShapeEntry]]:
    """The split of every class of a listing {synset: ids}, in Pixel2Mesh's class order, other classes after these."""
    for synset in listing:
        shapenet.check_name(synset, "the listing")
    known = [synset for synset in CLASS_ORDER if synset in listing]
    others = sorted(set(listing) - set(CLASS_ORDER))
    return {synset: split_class(synset, listing[synset], strict=strict) for synset in [*known, *others]}


def list_text(classes: Mapping[str, Sequence[shapenet.ShapeEntry]], part: str) -> str:
    """The lines of train_list.txt or test_list.txt (`part`: train or test), each ended by LF."""
    lines = [
        f"Data/ShapeNetP2M/{synset}/{shape.id}/rendering/{view:02d}.dat\n"
        for synset, shapes in classes.items()
        for shape in shapes
        for view in (shape.train_views if part == "train" else shape.test_views)
    ]
    return "".join(lines)


def git_blob_id(text: str) -> str:
    """The id that git gives a file with this content, to compare lists with published ones without keeping them."""
    data = text.encode()
    return hashlib.sha1(b"blob %d\0" % len(data) + data, usedforsecurity=False).hexdigest()
