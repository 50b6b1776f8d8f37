"""`ddf view`: a page that renders a field, a scene or a model live, opened in the browser or written as one file."""

import argparse
import dataclasses
import tempfile
import webbrowser
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddf.cli import arguments
from ddf.core import shipped_models

if TYPE_CHECKING:
    from ddf.io import viewer_page

EXAMPLES = (
    "ddf view rabbit",
    "ddf view rabbit rabbit.html",
    "ddf view rabbit armchair airliner row.html",
    "ddf view scene.yaml scene.html",
    "ddf view chair chair.html",
)
PAGE = ".html"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what is shown and the file."""
    parser.add_argument(
        "what",
        metavar="FIELD_or_SCENE_or_MODEL",
        nargs="+",
        action=_Shown,
        help="folder that `ddf fit` or `make train` wrote, a name that `ddf models` lists, or a scene file; several "
        "fields stand side by side; last, OUT.html: file to write (without it a temporary one is written and opened in "
        "the browser)",
    )
    arguments.mark_out(parser, "out")
    parser.add_argument(
        "--up", choices=arguments.UP_AXES, default="y", help="axis of fields that points up (default %(default)s)"
    )


class _Shown(argparse.Action):
    """What is shown, and the file to write: a last word that ends in .html."""

    def __call__(self, _parser: Any, namespace: argparse.Namespace, values: Any, _option: str | None = None) -> None:
        *words, last = values
        namespace.out = Path(last) if words and Path(last).suffix.lower() == PAGE else None
        namespace.what = [shipped_models.place(word) for word in (values if namespace.out is None else words)]


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Write the page, and open it where no file is named."""
    from ddf.io import viewer_page

    out = args.out
    page = page_of(args.what, args.up)
    if out is None:
        out = Path(tempfile.mkdtemp(prefix="ddf-view-")) / f"{page.title}.html"
    size = viewer_page.write(out, page)
    opened = args.out is None and webbrowser.open(out.as_uri())
    hint = "opened in the browser" if opened else "open it in any browser; it needs no server and no network"
    return {
        "out": out.as_posix(),
        "bytes": size,
        "fields": [field.record["name"] for field in page.fields],
        "opened": opened,
        "verdict": f"{out}: {size:,} bytes; {hint}",
    }


def page_of(what: Sequence[Path], up: str = "y") -> "viewer_page.Page":
    """The page of a field, of a scene file or of a model; of several fields side by side.

    Raises:
      FileNotFoundError, InputError: as `viewable.page` and `scene_file.read`; or what must stand alone does not.
    """
    from ddf.api import scene_file
    from ddf.core import checks
    from ddf.io import viewable

    scenes = [path for path in what if path.suffix in scene_file.SUFFIXES]
    if len(what) == 1:
        return _scene(what[0]) if scenes else _field(what[0], up)
    if scenes:
        raise checks.InputError(f"{scenes[0]}: a scene file is shown alone; it may name all fields")
    return viewable.row_page(what, up)


def _field(path: Path, up: str) -> "viewer_page.Page":
    """The page of a field with its first picture, or of a model."""
    from ddf.cli.field import load
    from ddf.io import viewable, viewer_page

    page = viewable.page(path, up)
    if page.encoders is not None:
        return page
    shape = load.framed(path if path.is_dir() else path.parent, ("depth", "normals"))
    return dataclasses.replace(page, first=viewer_page.first(shape, page.azimuth, up))


def _scene(file: Path) -> "viewer_page.Page":
    """The page of a scene file; a field that it names several times is in the page once."""
    from ddf.api import scene_file
    from ddf.io import viewable, viewer_page

    content = scene_file.read(file)
    scene = scene_file.build(content, file.parent).framed
    baked = {}
    for name in {placement.field for placement in content.objects}:
        folder = shipped_models.place(scene_file.place(file.parent, name))
        baked[name] = viewer_page.bake(viewable.field(folder), viewable.name_of(folder))
    fields = [viewer_page.placed(baked[placement.field], placement.similarity()) for placement in content.objects]
    page = viewable.scene_page(file.stem, fields, scene.lower, scene.upper, content.up, content.box is not None)
    if page.box is not None:  # the page cuts the box open
        return page
    return dataclasses.replace(page, first=viewer_page.first(scene, page.azimuth, content.up))
