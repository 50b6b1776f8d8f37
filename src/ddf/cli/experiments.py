"""Commands about experiments that need no checkout: their settings, and the lists of their shapes."""

import dataclasses
import importlib
import importlib.util
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from ddf.cli import results
from ddf.cli.declare import Arg, command
from ddf.core import errors

_WIDTH = 24  # of a value, from where on comments stand in a column


@command("experiment")
def config(action: Literal["show"], name: Annotated[str, Arg("NAME")]) -> dict[str, Any]:
    """Every setting of an experiment or a fit, with its unit, its reason and the paper's place.

    A file of one's own has `base: long_fit` and what differs.

    Args:
      action: print it as a file with all settings, which says the same.
      name: a file, or the name of one: fit, simple_fit, long_fit, paper_fit, or of an experiment in configs/.

    Examples:
      ddf config show long_fit
      ddf config show paper_fit --json
    """
    from ddf.core import config as config_files
    from ddf.core import schema
    from ddf.fit import fit_settings

    file = config_files.found_file(name)
    if importlib.util.find_spec("ddf_lab"):  # which knows all sections
        sections = importlib.import_module("ddf_lab.run").Run.read(file).sections()
    else:
        sections = {"fit": config_files.load(file, "fit", fit_settings.FitConfig)}
    every = [each for name, section in sections.items() for each in schema.listed(section, name)]
    changed = [each for each in every if each.value != each.default and not dataclasses.is_dataclass(each.value)]
    count = sum(not dataclasses.is_dataclass(each.value) for each in every)
    return {
        "config": file.as_posix(),
        "sections": {name: config_files.plain(section) for name, section in sections.items()},
        "changed": [each.key for each in changed],
        "table": list(_config_lines(sections)),
        "verdict": f"# {file}: {len(changed)} of {count} settings are not the default",
    }


def _config_lines(sections: Mapping[str, Any]) -> Iterator[str]:
    import yaml

    from ddf.core import schema

    def text(value: Any) -> str:
        plain = list(value) if isinstance(value, tuple) else value.as_posix() if isinstance(value, Path) else value
        return (
            yaml.safe_dump(plain, default_flow_style=True, sort_keys=False, allow_unicode=True, width=10_000)
            .removesuffix("\n...\n")
            .rstrip("\n")
        )

    for name, section in sections.items():
        yield f"{name}:"
        for each in schema.listed(section, name):
            part, depth = dataclasses.is_dataclass(each.value), each.key.count(".")
            own = f"{'  ' * depth}{each.key.rpartition('.')[2]}:{'' if part else f' {text(each.value)}'}"
            source = f" ({each.source})" if each.source else ""
            default = each.default if not part else None if each.default is None else each.value
            said = f"{each.says}{source}" if each.value == default else f"not {text(default)}{source}: {each.says}"
            yield f"{own:{_WIDTH + 2 * depth}} # {said}"


@command("experiment")
def split(
    source: Annotated[Path, Arg("IDS.json|SHAPENET_ROOT")],
    *,
    out: Annotated[Path, Arg("DIR", writes="folder")],
    strict: bool = False,
) -> dict[str, Any]:
    """The Pixel2Mesh train and test lists of a listing of shapes or of a ShapeNet root.

    Args:
      source: a JSON object {synset: [ids]}, or a root that holds ShapeNetRendering/.
      out: gets train_list.txt and test_list.txt.
      strict: shapes with views on both sides train whole (not Pixel2Mesh's split).

    Examples:
      ddf split ids.json --out lists
      ddf split /data/shapenet --out lists --strict
    """
    from ddf.core import storage
    from ddf.data import splits

    classes = splits.split(read_listing(source), strict=strict)
    result: dict[str, Any] = {"strict": strict}
    for part in ("train", "test"):
        text = splits.list_text(classes, part)
        path = out / f"{part}_list.txt"
        storage.write_text(path, text)
        result[part] = {"path": path.as_posix(), "lines": text.count("\n"), "git_blob": splits.git_blob_id(text)}
    result["classes"] = {
        synset: {
            "shapes": len(shapes),
            "train": sum(len(shape.train_views) for shape in shapes),
            "test": sum(len(shape.test_views) for shape in shapes),
        }
        for synset, shapes in classes.items()
    }
    pairs = [(synset, shape) for synset, shapes in classes.items() for shape in shapes]
    result["straddling"] = [f"{synset}/{shape.id}" for synset, shape in pairs if shape.train_views and shape.test_views]
    result["table"] = results.grid(
        ("class", "shapes", "train views", "test views"),
        [(synset, *counts.values()) for synset, counts in result["classes"].items()],
    )
    result["verdict"] = (
        f"{result['train']['lines']:,} train and {result['test']['lines']:,} test lines in {out}; "
        f"{len(result['straddling']):,} shapes lie on both sides"
    )
    return result


def read_listing(source: Path) -> dict[str, list[str]]:
    """{synset: ids} from a JSON file, or from the folders of a ShapeNet root."""
    from ddf.core import storage
    from ddf.data import shapenet

    if source.is_dir():
        return {synset: shapenet.list_shapes(source, synset) for synset in shapenet.list_classes(source)}
    if not source.is_file():
        raise errors.InputError(f"{source}: no such file or folder; give IDS.json or a root with ShapeNetRendering/")
    listing = storage.read_json(source)
    if not isinstance(listing, dict) or not all(isinstance(ids, list) for ids in listing.values()):
        raise errors.InputError(f"{source}: must hold one JSON object {{synset: [ids]}}; got something else")
    return {synset: [shapenet.check_name(name, str(source)) for name in ids] for synset, ids in listing.items()}
