"""How the package's reconstruction models tell their kind from other objects: by public shapes of all categories.

Positives are shapes of the model's category, negatives those of the others: public ones of the training side whose
licence asks for credit at most, and procedural ones. `HELD` categories only test.
"""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from ddf.data import cutouts, shapenet
from ddf.data.public import manifest, packages, shapes
from ddf.data.synthetic import write
from ddf.models import line_field, out_of_distribution
from ddf.reconstruction import framing

HELD = ("lamp", "bed")
SEED, VIEWS, PROCEDURAL = 99, 5, 60  # of the renders; shapes of each procedural category
Seen = tuple[str, bool, str, Path]  # category of a shape, whether it is learned from, its id, the folder of its renders


def tell_apart(folder: Path, category: str, renders: Path) -> str:
    """Add the direction that tells the kind to a model's file; how often the verdict is right, for its card.

    Args:
      folder: of the model. renders: folder that keeps the pictures.
    """
    trained = line_field.load(folder)
    assert trained.statistics is not None
    rows = [(seen, _features(trained, seen[3])) for seen in rendered(renders)]
    learn = [(seen, found) for seen, found in rows if seen[1]]
    own = [(seen[2], found) for seen, found in learn if seen[0] == category]
    direction, likeness = out_of_distribution.told_apart(
        torch.cat([found for _, found in own]),
        torch.cat([found for seen, found in learn if seen[0] != category]),
        [name for name, found in own for _ in found],
    )
    statistics = dataclasses.replace(trained.statistics, direction=direction, likeness=likeness)
    statistics.add_to(folder)
    tested = [(seen[0], statistics.score(found)) for seen, found in rows if not seen[1]]
    return _rates(category, tested)


def _rates(category: str, tested: Sequence[tuple[str, Float[np.ndarray, "views"]]]) -> str:
    """Which share of the pictures of each category is called none of the kind."""
    said = []
    for name in sorted({name for name, _ in tested}, key=lambda name: (name != category, name)):
        far = np.concatenate([score for kind, score in tested if kind == name]) >= out_of_distribution.FAR
        said.append(f"{far.mean():.0%} of {len(far)} {name}s")
    return f"`ddf reconstruct` calls no {category}: {', '.join(said)}, of shapes not learned from."


def rendered(root: Path) -> list[Seen]:
    """The shapes, whose pictures are drawn where they are not yet there."""
    found = []
    for row in manifest.rows():
        folder = shapenet.rendering_dir(root, shapenet.synset(row.category), row.id)
        if not (folder / shapenet.METADATA).exists():
            kept = packages.require(packages.PACKAGES[row.package], manifest.wanted(row.package))
            shapes.write_shape(root, SEED, kept, row, 0, VIEWS)
        learned = row.split == "train" and row.free and row.category not in HELD
        found.append((row.category, learned, row.id, folder))
    for category in write.WIDE:
        for index in range(PROCEDURAL):
            name = write.shape_id(SEED, category, index)
            folder = shapenet.rendering_dir(root, shapenet.synset(category), name)
            if not (folder / shapenet.METADATA).exists():
                write.write_shape(root, SEED, category, index, VIEWS, wide=True)
            found.append((category, True, name, folder))
    return found


@torch.no_grad()
def _features(trained: line_field.TrainedImageDDF, folder: Path) -> Float[Tensor, "views f"]:
    """Of the pictures of a shape."""
    pictures = [framing.Cutout(cutouts.read(path), framed=True) for path in sorted(folder.glob("*.png"))]
    crops = [framing.encoder_input(each.crop(framing.frame(trained, each), trained.image_size)) for each in pictures]
    return torch.cat(trained.network.shape_encoder.stages(torch.cat(crops)), dim=1)
