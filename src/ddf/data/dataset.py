"""The stage `dataset`: make (synthetic) or check (real) the shapes of an experiment, split them, write the index.

Both sources end in the same check of the same files, and the split is taken from the whole listing before broken shapes
are left out, so that a broken file moves no other shape to the other side.
"""

import functools
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from ddf.core import checks, parallel, provenance, storage
from ddf.data import shapenet, splits
from ddf.data.synthetic import write

ROOT_VARIABLE = "DDF_DATA"  # environment variable with the root of real data, set by `make ... DATA=`
SHARD_SIZES = {"synthetic": 4, "shapenet": 100}  # a shape takes about half a second to make, 10 ms to check
_NOT_V2 = "whose meshes are turned against the renders; v1 is needed"
CHECK_SIZE = 64  # pixels; any size reads the whole file


@dataclass(frozen=True)
class DatasetConfig:
    """Config section `dataset`.

    source: `synthetic` makes shapes; `shapenet` reads the root given by DATA=.
    categories: name to number of shapes; null takes all (real data only). A number on real data takes that many from
      the listing, evenly spread, for trials: its split is then not the published one.
    seed: of the synthetic shapes.
    views: renders per shape.
    strict: put shapes with views on both sides of the split whole into train.
    validation: share of the shapes that train alone which is held out of training, for choices: the last ones of the
      split. The paper names none: 0.
    """

    source: Literal["synthetic", "shapenet"]
    categories: dict[str, int | None]
    seed: int
    views: int
    strict: bool
    validation: float = 0.0

    def __post_init__(self) -> None:
        known = set(shapenet.SYNSETS) if self.source == "shapenet" else set(write.CATEGORIES)
        if not self.categories:
            raise checks.InputError(f"dataset.categories must name one of {', '.join(sorted(known))} at least")
        for name, count in self.categories.items():
            if name not in known:
                raise checks.InputError(f"dataset.categories must be among {', '.join(sorted(known))}; got {name!r}")
            if count is None and self.source == "synthetic":
                raise checks.InputError(f"dataset.categories.{name} must be a number for synthetic shapes; got null")
            if count is not None and not 2 <= count <= 100_000:
                raise checks.InputError(f"dataset.categories.{name} must be in [2, 100000]; got {count}")
        if not len(splits.VIEWS) <= self.views <= 100:
            raise checks.InputError(f"dataset.views must be in [5, 100], the split uses views 0 to 4; got {self.views}")
        if self.seed < 0:
            raise checks.InputError(f"dataset.seed must be >= 0; got {self.seed}")
        if not 0 <= self.validation < 1:
            raise checks.InputError(f"dataset.validation must be in [0, 1); got {self.validation}")


@dataclass(frozen=True)
class Item:
    """A shape to make or to check; `index` is its number among the synthetic shapes of its category."""

    category: str
    id: str
    index: int


def _checked(
    root: Path, views: int, seed: int | None, items: Sequence[Item], shard: parallel.Shard
) -> parallel.ShardResult:
    """Map over shapes: makes them (if `seed` is given) and checks them; one with a fault becomes a failure."""
    files: list[Path] = []
    failures = []
    for item in items:
        if seed is not None:
            files += write.write_shape(root, seed, item.category, item.index, views)
        try:
            check_shape(root, shapenet.SYNSETS[item.category], item.id, views)
        except (checks.InputError, OSError) as error:
            failures.append(parallel.Failure(item.id, "dataset", str(error)))
    return parallel.ShardResult(files, failures)


def check_shape(root: Path, synset: str, shape_id: str, num_views: int) -> None:
    """Raise InputError unless mesh, metadata of all views and the images that the split uses are there and whole."""
    model = shapenet.model_path(root, synset, shape_id)
    if not model.is_file() and (model.parent / "models" / "model_normalized.obj").is_file():
        raise checks.InputError(f"{model}: no such mesh; {model.parent} is laid out as ShapeNetCore.v2, {_NOT_V2}")
    if not model.is_file() or model.stat().st_size == 0:
        raise checks.InputError(f"{model}: no such mesh, or an empty file; unpack ShapeNetCore.v1 there")
    folder = shapenet.rendering_dir(root, synset, shape_id)
    poses = shapenet.read_cameras(folder)
    if len(poses) < num_views:
        raise checks.InputError(
            f"{folder / 'rendering_metadata.txt'}: must hold {num_views} lines, one per view; got {len(poses)}; "
            "unpack the renders of this shape again"
        )
    for view in splits.VIEWS:
        image = shapenet.read_image(shapenet.image_path(root, synset, shape_id, view), CHECK_SIZE)
        if not image[3].any():
            raise checks.InputError(f"{shapenet.image_path(root, synset, shape_id, view)}: alpha is 0 everywhere")


def make(config: DatasetConfig, out_dir: Path) -> dict[str, Any]:
    """Make or check all shapes and return the index; failures go to `out_dir`/failures.csv.

    The index changes when a file of the data set does (`parallel.digest`), so who depends on it need not watch them.

    Raises:
      InputError: the root is missing, or more than 2 % of the shapes are broken.
    """
    synthetic = config.source == "synthetic"
    root = out_dir if synthetic else real_root(os.environ)
    items = list_synthetic(config) if synthetic else list_real(config, root)
    if synthetic:
        remove_strangers(root, items)
    else:
        forget_checks(out_dir)
    failures = parallel.map_shards(
        functools.partial(_checked, root, config.views, config.seed if synthetic else None),
        items,
        shard_size=SHARD_SIZES[config.source],
        out_dir=out_dir,
        fingerprint=provenance.fingerprint([config.source, config.views, config.seed, str(root)], [], __name__),
        describe="dataset",
    )
    broken = {failure.id for failure in failures}
    categories = {}
    for name in config.categories:
        ids = [item.id for item in items if item.category == name]
        shapes = splits.split_class(shapenet.SYNSETS[name], ids, strict=config.strict)
        held = splits.held_out(shapes, config.validation)
        kept = [_entry(shape, shape.id in held) for shape in shapes if shape.id not in broken]
        categories[name] = {"synset": shapenet.SYNSETS[name], "shapes": kept}
    made = {"source": config.source, "seed": config.seed, "digest": parallel.digest(out_dir)}
    return {"root": root.as_posix(), **made, "categories": categories}


def _entry(shape: splits.ShapeViews, held: bool) -> dict[str, Any]:
    seen, unseen = list(shape.train_views), list(shape.test_views)
    return {
        "id": shape.id,
        "train_views": [] if held else seen,
        "test_views": unseen,
        "validation_views": seen if held else [],
    }


def real_root(environment: Mapping[str, str]) -> Path:
    """The absolute root of real data, from the environment; InputError when it is not given or not there."""
    given = environment.get(ROOT_VARIABLE, "")
    if not given:
        raise checks.InputError(
            "this experiment reads real ShapeNet data and no root is given; call "
            "`make reproduce-table CONFIG=configs/paper.yaml DATA=/path/to/shapenet`"
        )
    root = Path(given).expanduser().resolve()
    if not (root / shapenet.MODELS).is_dir() and (root / "ShapeNetCore.v2").is_dir():
        raise checks.InputError(f"{root}: holds ShapeNetCore.v2, {_NOT_V2}: unpack ShapeNetCore.v1 there")
    for name, what in ((shapenet.MODELS, "the meshes"), (shapenet.RENDERS, "the 3D-R2N2 renders")):
        if not (root / name).is_dir():
            raise checks.InputError(
                f"{root / name}: no such folder; DATA must be the root that holds {what} there, as in "
                "`make reproduce-table CONFIG=configs/paper.yaml DATA=/path/to/shapenet`"
            )
        shapenet.require_flat(root / name)
    return root


def list_synthetic(config: DatasetConfig) -> list[Item]:
    """The shapes to make."""
    return [
        Item(name, write.shape_id(config.seed, name, index), index)
        for name, count in config.categories.items()
        for index in range(count or 0)
    ]


def list_real(config: DatasetConfig, root: Path) -> list[Item]:
    """The shapes that have a folder of renders, in the natural order of the split, or an even choice of them."""
    items = []
    for name, count in config.categories.items():
        synset = shapenet.SYNSETS[name]
        ids = [shape.id for shape in splits.split_class(synset, shapenet.list_shapes(root, synset))]
        if count is not None and count < len(ids):
            ids = [ids[i * len(ids) // count] for i in range(count)]
        items += [Item(name, shape_id, index) for index, shape_id in enumerate(ids)]
    return items


def remove_strangers(root: Path, items: Sequence[Item]) -> None:
    """Delete shapes of an earlier configuration from a synthetic root, so that a listing of it is the data set."""
    wanted = {(shapenet.SYNSETS[item.category], item.id) for item in items}
    for part in (shapenet.MODELS, shapenet.RENDERS):
        for folder in (root / part).glob("*/*"):
            if (folder.parent.name, folder.name) not in wanted:
                shutil.rmtree(folder)


def forget_checks(out_dir: Path) -> None:
    """Delete what earlier checks found, because the user may have mended the data since."""
    for record in out_dir.glob(storage.RECORDS):
        record.unlink()


def write_index(config: DatasetConfig, out_dir: Path) -> None:
    """Run the stage: `make`, then index.json under its final name; an index of an earlier run is gone meanwhile."""
    (out_dir / "index.json").unlink(missing_ok=True)
    storage.write_json(out_dir / "index.json", make(config, out_dir))
