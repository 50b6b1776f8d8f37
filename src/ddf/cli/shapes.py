"""Commands about shapes to train on: those of other people, and one's own."""

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from ddf.cli import results
from ddf.cli.declare import Arg, command
from ddf.core import errors

if TYPE_CHECKING:
    from ddf.data.public import packages

Axis = Literal["x", "y", "z", "-x", "-y", "-z"]


@command("mesh", actions="[get [CATEGORY ...] | add FOLDER]")
def shapes() -> dict[str, Any]:
    """Shapes to train on: chairs, planes, cars, ... of other people; fetching them; adding your own.

    410 chairs, planes, cars, tables, sofas, cabinets, lamps and beds, each with its own licence, from nine packages of
    Debian's archive. `get` runs `apt-get download`, which needs no rights, or takes `.deb` files from a folder. 108 MB
    are kept in `~/.cache/ddf/shapes`. `add` makes training shapes of [your own meshes](own_shapes.md).

    Examples:
      ddf shapes
      ddf shapes get
      ddf shapes get chair table --from ~/Downloads
      ddf shapes add ~/chairs --category chair --up z --front x
    """
    from collections import Counter

    from ddf.data.public import manifest, packages

    rows = manifest.rows()
    counts = Counter((row.category, part) for row in rows for part in (row.split, row.licence))
    licences = sorted({row.licence for row in rows})
    header = ("category", *manifest.SPLITS, *licences)
    table = [(name, *(counts[name, part] for part in header[1:])) for name in sorted({row.category for row in rows})]
    turned = list(zip(header, *table, strict=True))
    credits = {licence: sorted({row.creator for row in rows if row.licence == licence}) for licence in licences}
    return {
        "categories": [dict(zip(header, entry, strict=True)) for entry in table],
        "packages": [_described(package) for package in packages.PACKAGES.values()],
        "credits": credits,
        "table": [
            *results.grid(turned[0], turned[1:]),
            "",
            *(line for licence, names in credits.items() for line in results.folded(f"{licence}: {', '.join(names)}")),
            "",
        ],
        "verdict": f"{len(rows)} shapes of {len(packages.PACKAGES)} packages; `ddf shapes get` fetches them",
    }


@shapes.action("get")
def shapes_get(
    categories: Annotated[list[str], Arg("CATEGORY", nargs="*")],
    *,
    source: Annotated[Path | None, Arg("DIR", ("--from",))] = None,
) -> dict[str, Any]:
    """Fetch the shapes of some categories.

    Args:
      categories: of the list that `ddf shapes` prints; else all.
      source: folder with the packages' .deb files.
    """
    from ddf.data.public import manifest, packages

    known = sorted({row.category for row in manifest.rows()})
    for name in categories:
        if name not in known:
            raise errors.InputError(f"no category is called {name!r}; there are {', '.join(known)}")
    rows = manifest.of(categories or known)
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


@shapes.action("add")
def shapes_add(
    source: Annotated[Path, Arg("FOLDER")],
    *,
    category: Annotated[str, Arg("NAME")] = "",
    up: Axis = "y",
    front: Axis = "z",
    out: Annotated[Path | None, Arg("OUT_DIR", writes="folder")] = None,
) -> dict[str, Any]:
    """Look over your own meshes, and keep those that can be used for `dataset.own` of an experiment.

    Args:
      source: with meshes in it and below, or with a manifest.csv that lists them; or such a table.
      category: of the meshes; of a manifest, the ones to take.
      up: axis of the files that points up.
      front: axis of the files that points ahead: where one looks who sits in the chair.
      out: gets meshes, manifest.csv and contact_sheet.webp (default ~/.local/share/ddf/shapes).
    """
    from ddf.core import storage
    from ddf.data.public import adding, manifest
    from ddf.pictures import picture_strips

    folder = out or Path(os.environ.get("XDG_DATA_HOME") or "~/.local/share", "ddf", "shapes").expanduser()
    storage.require_not_read(folder / manifest.FILE)
    taken, left_out = adding.add(folder, source, {"category": category, "up": up, "front": front})
    seen = [(each["id"], [picture_strips.on_white(v / 255) for v in adding.views(folder, each)]) for each in taken]
    storage.write_bytes(folder / "contact_sheet.webp", picture_strips.contact_sheet(seen))
    sides = ", ".join(f"{sum(each['split'] == side for each in taken)} {side}" for side in manifest.SPLITS)
    usual = {"openings": "0", "pieces": "1", "note": ""}
    opened, several, noted = (sum(each[name] != value for each in taken) for name, value in usual.items())
    verdict = f"{len(taken)} of {len(taken) + len(left_out)} meshes are in {folder} ({sides}): {opened} with openings, "
    verdict += f"{several} of several pieces, {noted} with a note in manifest.csv; look at contact_sheet.webp there, "
    verdict += f"then train with dataset.own: {folder.absolute()}"
    return {"out": folder.as_posix(), "taken": taken, "left_out": left_out, "table": {}, "verdict": verdict}


def _described(package: "packages.Package") -> dict[str, Any]:
    from ddf.data.public import packages

    kept = packages.kept(package)
    return {
        "name": package.name,
        "version": package.version,
        "bytes": package.size,
        "sha256": package.sha256,
        "path": kept.as_posix() if kept.is_file() else None,
    }
