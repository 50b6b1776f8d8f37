"""Writes the live fields of docs/gallery.md: `make docs` calls it with the folder of the site's page."""

import argparse
from pathlib import Path

from ddf.cli import views
from ddf.core import shipped_models
from ddf.io import viewer_page

FIELDS = tuple(model.name for model in shipped_models.listed() if model.kind == "field")
SCENE = Path(__file__).resolve().parents[1] / "examples" / "scene.yaml"
NAMES = (*FIELDS, SCENE.stem)


def write(out: Path, names: tuple[str, ...] = NAMES) -> None:
    """Of each name a page and, as a picture, what it shows first."""
    out.mkdir(parents=True, exist_ok=True)
    for name in names:
        page = views.page_of([SCENE if name == SCENE.stem else shipped_models.place(name)])
        viewer_page.write(out / f"{name}.html", page)
        (out / f"{name}.webp").write_bytes(page.first)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    write(parser.parse_args().out)
