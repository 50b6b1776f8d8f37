"""`ddf split`: the Pixel2Mesh train and test lists of a listing of shapes or a ShapeNet root."""

import argparse
import json
from pathlib import Path
from typing import Any

from ddf.cli import arguments, results

EXAMPLES = ("ddf split ids.json --out lists", "ddf split /data/shapenet --out lists --strict")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the source, the output folder and the treatment of straddling shapes."""
    parser.add_argument(
        "source",
        metavar="IDS.json|SHAPENET_ROOT",
        type=Path,
        help="a JSON object {synset: [ids]}, or a root that holds ShapeNetRendering/",
    )
    arguments.add_folder(parser, "gets train_list.txt and test_list.txt", "--out", metavar="DIR", required=True)
    parser.add_argument(
        "--strict", action="store_true", help="shapes with views on both sides train whole (not Pixel2Mesh's split)"
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Write both lists; returns line counts, git blob ids, counts per class and the straddling shapes."""
    from ddf.core import storage
    from ddf.data import splits

    classes = splits.split(read_listing(args.source), strict=args.strict)
    result: dict[str, Any] = {"strict": args.strict}
    for part in ("train", "test"):
        text = splits.list_text(classes, part)
        path = args.out / f"{part}_list.txt"
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
    result["straddling"] = [f"{synset}/{shape.id}" for synset, shape in pairs if shape.straddles]
    result["table"] = results.grid(
        ("class", "shapes", "train views", "test views"),
        [(synset, *counts.values()) for synset, counts in result["classes"].items()],
    )
    result["verdict"] = (
        f"{result['train']['lines']:,} train and {result['test']['lines']:,} test lines in {args.out}; "
        f"{len(result['straddling']):,} shapes lie on both sides"
    )
    return result


def read_listing(source: Path) -> dict[str, list[str]]:
    """{synset: ids} from a JSON file, or from the folders of a ShapeNet root.

    Raises:
      InputError: neither is there, or the file holds something else; it is named.
    """
    from ddf.core import checks
    from ddf.data import shapenet

    if source.is_dir():
        return {synset: shapenet.list_shapes(source, synset) for synset in shapenet.list_classes(source)}
    if not source.is_file():
        raise checks.InputError(f"{source}: no such file or folder; give IDS.json or a root with ShapeNetRendering/")
    checks.require_content(source)
    try:
        listing = json.loads(
            source.read_text(encoding="utf-8-sig"), object_pairs_hook=lambda pairs: _once(pairs, source)
        )
    except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise checks.InputError(f"{source}: not valid JSON ({error})") from error
    if not isinstance(listing, dict) or not all(isinstance(ids, list) for ids in listing.values()):
        raise checks.InputError(f"{source}: must hold one JSON object {{synset: [ids]}}; got something else")
    return {synset: [shapenet.check_name(name, str(source)) for name in ids] for synset, ids in listing.items()}


def _once(pairs: list[tuple[str, Any]], source: Path) -> dict[str, Any]:
    """A JSON object, unless a key is in it twice: the first one's shapes would be lost."""
    from ddf.core import checks

    listing: dict[str, Any] = {}
    for key, value in pairs:
        if key in listing:
            raise checks.InputError(f"{source}: {key!r} is given twice; give every synset once, with all its shapes")
        listing[key] = value
    return listing
