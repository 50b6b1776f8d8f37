"""Writes the live fields of docs/gallery.md: `make docs` calls it with the folder of the site's page."""

import argparse
import tempfile
from pathlib import Path

from ddf.cli import views
from ddf.core import shipped_models
from ddf.data.synthetic import showcase
from ddf.fields.grid import octree
from ddf.fit import patch_fitting
from ddf.io import viewer_page

NETWORKS = ("rabbit", "armchair", "airliner", "nested")  # of `ddf models`
PATCHES = ("rabbit", "armchair", "airliner")
SCENE = Path(__file__).resolve().parents[1] / "examples" / "scene.yaml"
NAMES = (*NETWORKS, *(f"{name}-patches" for name in PATCHES), SCENE.stem)


def write(out: Path, names: tuple[str, ...] = NAMES) -> None:
    """Of each name a page and, as a picture, what it shows first."""
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            page = views.page_of([_place(name, Path(folder))])
            viewer_page.write(out / f"{name}.html", page)
            (out / f"{name}.webp").write_bytes(page.first)


def _place(name: str, folder: Path) -> Path:
    """A field's folder, or the scene."""
    if name == SCENE.stem:
        return SCENE
    if name in NETWORKS:
        return shipped_models.place(name)
    patch_fitting.fit(showcase.SHAPES[name.removesuffix("-patches")](), octree.PatchConfig(), folder / name)
    return folder / name


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    write(parser.parse_args().out)
