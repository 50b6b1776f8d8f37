"""`ddf view`: a page that renders a field, a scene or a model live, opened in the browser or written as one file."""

import argparse
import tempfile
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddf.cli import arguments
from ddf.core import shipped_models

if TYPE_CHECKING:
    from ddf.export import viewer_page

EXAMPLES = (
    "ddf view rabbit",
    "ddf view rabbit rabbit.html",
    "ddf view scene.yaml scene.html",
    "ddf view chair chair.html",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what is shown and the file."""
    parser.add_argument(
        "what",
        metavar="FIELD_or_SCENE_or_MODEL",
        type=shipped_models.place,
        help="folder that `ddf fit` or `make train` wrote, a name that `ddf models` lists, or a scene file",
    )
    arguments.add_out(
        parser,
        "out",
        "OUT.html",
        "file to write; without it a temporary one is written and opened in the browser",
        optional=True,
    )
    parser.add_argument(
        "--up", choices=arguments.UP_AXES, default="y", help="axis of a field that points up (default %(default)s)"
    )
    parser.add_argument(
        "--wasm", action="store_true", help="of a field: 5 MB more, and the page does without WebGL2, on the CPU"
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Write the page, and open it where no file is named."""
    from ddf.core import checks
    from ddf.export import viewer_page

    out = args.out
    if out is not None and out.suffix.lower() != ".html":
        raise checks.InputError(f"{out}: must end in .html")
    page = page_of(args.what, args.up, args.wasm)
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


def page_of(what: Path, up: str = "y", wasm: bool = False) -> "viewer_page.Page":
    """The page of a field or of a scene file.

    Raises:
      FileNotFoundError, InputError: as `viewable.page` and `scene_file.read`.
    """
    from ddf.api import scene_file
    from ddf.export import viewable

    return _scene(what) if what.suffix in scene_file.SUFFIXES else viewable.page(what, up, wasm)


def _scene(file: Path) -> "viewer_page.Page":
    """The page of a scene file; a field that it names several times is in the page once."""
    from ddf.api import scene_file
    from ddf.export import viewable, viewer_fields
    from ddf.shape import shape_field

    content = scene_file.read(file)
    scene = scene_file.build(content, file.parent).framed
    baked = {}
    for name in {placement.field for placement in content.objects}:
        folder = shipped_models.place(scene_file.place(file.parent, name))
        baked[name] = viewer_fields.bake(shape_field.load(folder), viewable.name_of(folder))
    fields = [viewer_fields.placed(baked[placement.field], placement.similarity()) for placement in content.objects]
    return viewable.scene_page(file.stem, fields, scene.lower, scene.upper, content.up, content.box is not None)
