"""`ddf shapes`: shapes of other people that anyone can install, and fetching them."""

import argparse
import sys
from collections import Counter
from pathlib import Path
from typing import Any

from ddf.cli import results
from ddf.core import checks
from ddf.data.public import manifest, packages

EXAMPLES = ("ddf shapes", "ddf shapes get", "ddf shapes get chair table --from ~/Downloads")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what may follow: nothing, or `get [CATEGORY ...] [--from DIR]`."""
    parser.set_defaults(action="list")
    actions = parser.add_subparsers(dest="action", metavar="[get [CATEGORY ...]]", required=False)
    get = actions.add_parser("get", help="fetch the shapes of some categories", description="Fetch shapes.")
    get.add_argument("categories", metavar="CATEGORY", nargs="*", help="of the list that `ddf shapes` prints; else all")
    get.add_argument("--from", dest="source", metavar="DIR", type=Path, help="folder with the packages' .deb files")
    get.add_argument("--json", action="store_true", default=argparse.SUPPRESS, help="print one JSON object on stdout")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """The list, or what was fetched."""
    known = sorted({row.category for row in manifest.rows()})
    if args.action == "get":
        for name in args.categories:
            if name not in known:
                raise checks.InputError(f"no category is called {name!r}; there are {', '.join(known)}")
        return _get(args.categories or known, args.source)
    rows = manifest.rows()
    counts = Counter((row.category, part) for row in rows for part in (row.split, row.licence))
    licences = sorted({row.licence for row in rows})
    header = ("category", *manifest.SPLITS, *licences)
    table = [(name, *(counts[name, part] for part in header[1:])) for name in known]
    credits = {licence: sorted({row.creator for row in rows if row.licence == licence}) for licence in licences}
    lines = [f"{licence}: {', '.join(names)}" for licence, names in credits.items()]
    return {
        "categories": [dict(zip(header, entry, strict=True)) for entry in table],
        "packages": [_described(package) for package in packages.PACKAGES.values()],
        "credits": credits,
        "table": [*results.grid(header, table), "", *lines, ""],
        "verdict": f"{len(rows)} shapes of {len(packages.PACKAGES)} packages; `ddf shapes get` fetches them",
    }


def _get(categories: list[str], source: Path | None) -> dict[str, Any]:
    rows = manifest.of(categories)
    needed = [package for package in packages.PACKAGES.values() if any(row.package == package.name for row in rows)]
    if source is None:
        packages.require_means(
            [package for package in needed if not packages.has(package, manifest.wanted(package.name))]
        )
    for package in needed:
        sys.stderr.write(f"{package}: {package.size / 1e6:.0f} MB, SHA-256 {package.sha256}\n")
        packages.require(package, manifest.wanted(package.name), source)
    return {
        "packages": [_described(package) for package in needed],
        "shapes": len(rows),
        "table": {package.name: packages.kept(package).as_posix() for package in needed},
        "verdict": f"{len(rows)} shapes in {packages.cache()}",
    }


def _described(package: packages.Package) -> dict[str, Any]:
    kept = packages.kept(package)
    return {
        "name": package.name,
        "version": package.version,
        "bytes": package.size,
        "sha256": package.sha256,
        "path": kept.as_posix() if kept.is_file() else None,
    }
