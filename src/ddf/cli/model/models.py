"""`ddf models`: the trained models and fields that come with the package, and copies of them."""

import argparse
from pathlib import Path
from typing import Any

from ddf.cli import arguments, results
from ddf.core import shipped_models

EXAMPLES = ("ddf models", "ddf models get chair chair_model")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what may follow: nothing, or `get NAME OUT`."""
    parser.set_defaults(action="list")
    actions = parser.add_subparsers(dest="action", metavar="[get NAME OUT]", required=False)
    get = actions.add_parser("get", help="copy the files of a model to a folder", description="Copy a model's files.")
    get.add_argument("name", metavar="NAME", help="of the list that `ddf models` prints")
    arguments.add_folder(get, "files of the same name are replaced", metavar="OUT")
    get.add_argument("--json", action="store_true", default=argparse.SUPPRESS, help="print one JSON object on stdout")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """The list, or what was copied; every command that takes a FIELD or MODEL takes these names too."""
    models = shipped_models.listed()
    if args.action == "get":
        return _copy({model.name: model for model in models}, args.name, args.out)
    rows = [(m.name, m.kind, f"{m.num_bytes / 1e6:.1f} MB", m.summary) for m in models]
    return {
        "models": [
            {
                "name": m.name,
                "kind": m.kind,
                "path": m.folder.as_posix(),
                "bytes": m.num_bytes,
                "summary": m.summary,
                "files": sorted(m.files),
            }
            for m in models
        ],
        "table": results.grid(("name", "kind", "size", "what"), rows),
        "verdict": f"{len(models)} models; a name stands wherever a command takes a FIELD or a MODEL of its kind",
    }


def _copy(models: dict[str, shipped_models.ShippedModel], name: str, out: Path) -> dict[str, Any]:
    """Copy one model's files."""
    from ddf.core import checks, errors, storage

    if name not in models:
        raise checks.InputError(f"no model is called {name!r}; there are {errors.known_names(name, models)}")
    model = models[name]
    for file in model.files:
        storage.write_bytes(out / file, (model.folder / file).read_bytes())
    return {
        "name": name,
        "kind": model.kind,
        "path": out.as_posix(),
        "bytes": model.num_bytes,
        "files": sorted(model.files),
        "verdict": f"{len(model.files)} files of {name} in {out}",
    }
