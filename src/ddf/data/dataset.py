"""The stage `dataset`: make (synthetic, public) or check (ShapeNet) the shapes of an experiment, split and index them.

All sources end in the same check of the same files, and the split is taken from the whole listing before broken shapes
are left out, so that a broken file moves no other shape to the other side.
"""

import functools
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

from ddf.core import checks, parallel, provenance, schema, storage
from ddf.core.schema import setting
from ddf.data import shapenet, splits
from ddf.data.public import manifest, packages, shapes
from ddf.data.synthetic import write

ROOT_VARIABLE = "DDF_DATA"  # environment variable with the root of real data, set by `make ... DATA=`
_NOT_V2 = "whose meshes are turned against the renders; v1 is needed"
CHECK_SIZE = 64  # pixels; any size reads the whole file


@dataclass(frozen=True)
class PublicConfig(schema.Checked):
    """Public shapes, and one's own, in a data set: all of the categories, split as their manifest says."""

    views: int = setting(12, "renders per shape", least=len(splits.VIEWS), most=100)
    copies: int = setting(0, "variations of each training shape beside it", least=0, most=1000)


@dataclass(frozen=True)
class DatasetConfig(schema.Checked):
    """Section `dataset`.

    source: made (`synthetic`), of `ddf shapes` (`public`), `both`, of `ddf shapes add` (`own`), of DATA= (`shapenet`).
    categories: a number on real data takes that many from the listing, evenly spread, for trials: its split is then not
      the published one.
    validation: the last ones of the split; the manifest has its own.
    train_on: `shippable`: wide synthetic shapes, and public ones whose licence asks for credit at most; other public
      ones of the training side validate.
    """

    source: Literal["synthetic", "public", "both", "own", "shapenet"] = setting("shapenet", "of the shapes", "§4.3")
    categories: dict[str, int | None] = setting(
        {"chair": None, "plane": None, "car": None},
        "synthetic or ShapeNet shapes of each; null: none of them, or all",
        "table si3dr",
    )
    seed: int = setting(0, "of synthetic shapes; choices are made on validation shapes or with another one", least=0)
    views: int = setting(24, "renders per shape; the split uses 00 to 04", "§4.3", least=len(splits.VIEWS), most=100)
    strict: bool = setting(False, "whether shapes with views on both sides of the split are all trained on", "§4.3")
    validation: float = setting(0.0, "share of the training shapes that is held out, for choices", least=0, below=1)
    public: PublicConfig = setting(PublicConfig(), "the shapes of `ddf shapes`, where these are taken, and own ones")
    own: Path | None = setting(None, "folder that `ddf shapes add` wrote, whose shapes are taken too")
    train_on: Literal["both", "shippable"] = setting("both", "of `both`: the training shapes")

    @property
    def made(self) -> tuple[str, ...]:
        """Sources of the shapes that are made."""
        return {"both": ("synthetic", "public"), "shapenet": ()}.get(self.source, (self.source,))

    def rows(self) -> list[manifest.Row]:
        """The public shapes of the categories, without relatives of test shapes, and own ones."""
        public = manifest.unrelated(manifest.of(self.categories)) if "public" in self.made else []
        return public + (manifest.own(self.own, self.categories) if self.own else [])

    def __post_init__(self) -> None:
        super().__post_init__()
        public = {row.category for row in manifest.rows()} if "public" in self.made else set()
        known = set(shapenet.SYNSETS) if self.source == "shapenet" else public
        known |= set(write.CATEGORIES) if "synthetic" in self.made else set()
        if (self.own is None and self.source == "own") or (self.own is not None and not self.made):
            raise checks.InputError(f"own must be a folder of `ddf shapes add`, of shapenet null; got {self.own}")
        if not self.categories:
            raise checks.InputError(f"categories must name one of {', '.join(sorted(known))} at least")
        for name, count in self.categories.items():
            if self.own is not None:
                shapenet.check_name(name, "categories")
            elif name not in known:
                raise checks.InputError(f"categories must be among {', '.join(sorted(known))}; got {name!r}")
            if count is None and self.source == "synthetic" and self.own is None:
                raise checks.InputError(f"categories.{name} must be a number for synthetic shapes; got null")
            if count is not None and self.made and not ("synthetic" in self.made and name in write.CATEGORIES):
                raise checks.InputError(f"categories.{name} must be null, all public or own shapes; got {count}")
            if count is not None and not 2 <= count <= 100_000:
                raise checks.InputError(f"categories.{name} must be in [2, 100000]; got {count}")


@dataclass(frozen=True)
class Item:
    """A shape to make or to check; `index` is its number among the synthetic shapes of its category, or the number of
    the variation of the public or own shape `row`. wide: of the wide families of synthetic shapes.
    """

    category: str
    id: str
    index: int
    row: manifest.Row | None = None
    wide: bool = False


def _checked(
    root: Path, config: DatasetConfig, archives: Mapping[str, Path], items: Sequence[Item], shard: parallel.Shard
) -> parallel.ShardResult:
    """Map over shapes: makes them, but for those of shapenet, and checks them; one with a fault becomes a failure.

    archives: those of the packages with public shapes by name, and the folder of own ones.
    """
    files: list[Path] = []
    failures = []
    for item in items:
        views = config.public.views if item.row else config.views
        try:
            if item.row is not None:
                archive = archives[item.row.package]
                files += shapes.write_shape(root, config.seed, archive, item.row, item.index, views)
        except checks.InputError as error:
            failures.append(parallel.Failure(item.id, "dataset", str(error)))
            continue
        if item.row is None and config.made:
            files += write.write_shape(root, config.seed, item.category, item.index, views, wide=item.wide)
        try:
            check_shape(root, shapenet.synset(item.category), item.id, views)
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
    """Make or check all shapes and return the index; failures go to `out_dir`/failures.csv, more than 2 % are refused.

    The index changes when a file of the data set does (`parallel.digest`), so who depends on it need not watch them.
    """
    root = out_dir if config.made else real_root(os.environ)
    listed = _to_make(config) if config.made else _real(config, root)
    entries = {name: _entries(config, name, listed) for name in config.categories}
    if empty := [name for name, shapes_of_it in entries.items() if not shapes_of_it]:
        raise checks.InputError(f"categories.{empty[0]}: {config.own} has no such shape; call `ddf shapes add`")
    sides = {(name, entry.id): entry for name, own in entries.items() for entry in own}
    shown = {key for key, entry in sides.items() if entry.train_views or entry.test_views or entry.validation_views}
    items = [item for item in listed if (item.category, item.id) in shown]
    if config.train_on == "shippable":
        trained = {key for key, entry in sides.items() if entry.train_views}
        items = [replace(item, wide=not item.row and (item.category, item.id) in trained) for item in items]
    names = sorted({item.row.package for item in items if item.row is not None} - {manifest.OWN})
    needed = {packages.PACKAGES[name]: manifest.wanted(name) for name in names}
    packages.require_means([package for package, wanted in needed.items() if not packages.has(package, wanted)])
    archives = {package.name: packages.require(package, wanted) for package, wanted in needed.items()}
    archives |= {manifest.OWN: config.own.expanduser()} if config.own else {}
    if config.made:
        remove_strangers(root, items)
    else:  # forget what earlier checks found: the user may have mended the data since
        for record in out_dir.glob(storage.RECORDS):
            record.unlink()
    changing = [config.source, config.views, config.seed, str(root)]
    if rows := config.rows():
        changing += [config.public.views, *map(str, rows)]
    if config.train_on == "shippable":
        changing.append(config.train_on)
    failures = parallel.map_shards(
        functools.partial(_checked, root, config, archives),
        items,
        shard_size=4 if config.made else 100,  # half a second to make one, 10 ms to check
        out_dir=out_dir,
        fingerprint=provenance.fingerprint(changing, [], __name__),
        describe="dataset",
    )
    broken = {failure.id for failure in failures}
    categories = {}
    for name, own in entries.items():
        kept = [asdict(entry) for entry in own if (name, entry.id) in shown and entry.id not in broken]
        categories[name] = {"synset": shapenet.synset(name), "shapes": kept}
    kinds = sorted({"public" if item.row else "synthetic" for item in items})
    source = config.source if config.own is None else kinds[0] if len(kinds) == 1 else "both"
    made = {"source": source, "seed": config.seed, "digest": parallel.digest(out_dir)}
    return {"root": root.as_posix(), **made, "categories": categories}


def _entries(config: DatasetConfig, name: str, listed: Sequence[Item]) -> list[shapenet.ShapeEntry]:
    """The shapes of a category with their views on each side of the split."""
    own = [item for item in listed if item.category == name]
    split = splits.split_class(shapenet.synset(name), [i.id for i in own if i.row is None], strict=config.strict)
    held = splits.held_out(split, config.validation)
    made = [replace(s, train_views=(), validation_views=s.train_views) if s.id in held else s for s in split]
    return made + [_public_entry(config, item.row, item.id) for item in own if item.row]


def _split(config: DatasetConfig, row: manifest.Row) -> str:
    """The side of a public shape: the manifest's, but that what may not be shipped trains nothing that is."""
    barred = config.train_on == "shippable" and row.split == "train" and not row.free
    return "validation" if barred else row.split


def _public_entry(config: DatasetConfig, row: manifest.Row, name: str) -> shapenet.ShapeEntry:
    """Training shapes are seen in all views, others in those that a split uses."""
    split = _split(config, row)
    shown = tuple(range(config.public.views)) if split == "train" else splits.VIEWS
    return shapenet.ShapeEntry(name, **{f"{side}_views": shown if side == split else () for side in manifest.SPLITS})


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


def _to_make(config: DatasetConfig) -> list[Item]:
    """Synthetic shapes, then public and own ones: all of the categories, and copies of those that train."""
    counts = config.categories.items() if "synthetic" in config.made else ()
    items = [Item(name, write.shape_id(config.seed, name, i), i) for name, count in counts for i in range(count or 0)]
    for row in config.rows():
        copies = config.public.copies if _split(config, row) == "train" else 0
        items += [Item(row.category, shapes.copy_id(row, copy), copy, row) for copy in range(1 + copies)]
    return items


def _real(config: DatasetConfig, root: Path) -> list[Item]:
    """The shapes that have a folder of renders, in the natural order of the split, or an even choice of them."""
    items = []
    for name, count in config.categories.items():
        synset = shapenet.synset(name)
        ids = [shape.id for shape in splits.split_class(synset, shapenet.list_shapes(root, synset))]
        if count is not None and count < len(ids):
            ids = [ids[i * len(ids) // count] for i in range(count)]
        items += [Item(name, shape_id, index) for index, shape_id in enumerate(ids)]
    return items


def remove_strangers(root: Path, items: Sequence[Item]) -> None:
    """Delete shapes of an earlier configuration from a synthetic root, so that a listing of it is the data set."""
    wanted = {(shapenet.synset(item.category), item.id) for item in items}
    for part in (shapenet.MODELS, shapenet.RENDERS):
        for folder in (root / part).glob("*/*"):
            if (folder.parent.name, folder.name) not in wanted:
                shutil.rmtree(folder)


def write_index(config: DatasetConfig, out_dir: Path) -> None:
    """Run the stage: `make`, then index.json under its final name; an index of an earlier run is gone meanwhile."""
    (out_dir / "index.json").unlink(missing_ok=True)
    storage.write_json(out_dir / "index.json", make(config, out_dir))
