"""`ddf view`: a page that renders a field live, opened in the browser or written as one file."""

import argparse
import tempfile
import webbrowser
from pathlib import Path
from typing import Any

from ddf.cli import arguments

EXAMPLES = (
    "ddf view rabbit",
    "ddf view rabbit rabbit.html",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare field and file."""
    arguments.add_field(parser)
    arguments.add_out(
        parser,
        "out",
        "OUT.html",
        "file to write; without it a temporary one is written and opened in the browser",
        optional=True,
    )
    parser.add_argument(
        "--up", choices=arguments.UP_AXES, default="y", help="axis of the mesh that points up (default %(default)s)"
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Write the page, and open it where no file is named."""
    from ddf.core import checks
    from ddf.export import viewable, viewer_page

    out = args.out
    if out is not None and out.suffix.lower() != ".html":
        raise checks.InputError(f"{out}: must end in .html")
    page = viewable.page(args.field, args.up)
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
