"""A field for each everyday mesh of a folder, as `ddf fit` makes it, rendered beside the mesh: one sheet, one table.

Everyday are the meshes whose names do not begin with `hard_` or `bad_`. Writes contact_sheet.webp and contact_sheet.csv
to reports/fit_proof. Fitted fields stay in artifacts/contact_sheet: a second call fits what is missing or has changed.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from bench.fits import fit_curves
from bench.lib import measuring, side_by_side
from ddf.core import checks, config, provenance, storage
from ddf.fit import fit_settings, fitting, shape_field
from ddf.geometry import mesh_io
from ddf.pictures import field_pictures, picture_strips
from ddf_lab.report.shape import shape_views

ON_DEMAND = "make fit-proof"
NAME = "contact_sheet"
CONFIG = Path("configs/fit.yaml")
FIELDS, OUT = Path("artifacts") / NAME, measuring.PAGES / "fit_proof"
SHEET, TABLE, DONE = f"{NAME}.webp", f"{NAME}.csv", "done.json"
NOT_EVERYDAY = ("hard_", "bad_")
SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb")
UP = {".stl": "z"}  # by habit of programs that write such files; y of all others
COLUMNS = tuple(f"{name}, {view}" for view, _ in shape_views.OUTSIDE for name in ("depth", "mesh", "normals", "mesh"))


@dataclass(frozen=True)
class Fitted:
    """A mesh, the folder of its field, the axis that points up, and the threads that the fit had."""

    file: Path
    mesh: mesh_io.Mesh
    folder: Path
    up: str
    threads: int


def everyday(folder: Path) -> list[Path]:
    """Mesh files by name.

    Raises:
      InputError: there is none.
    """
    found = [file for file in folder.iterdir() if file.suffix in SUFFIXES] if folder.is_dir() else []
    chosen = sorted(file for file in found if not file.name.startswith(NOT_EVERYDAY))
    if not chosen:
        raise checks.InputError(f"{folder}: holds no everyday mesh ({', '.join(SUFFIXES)}); name a folder of meshes")
    return chosen


def fitted(file: Path, section: fit_settings.FitConfig) -> Fitted:
    """The field of a mesh, fitted now, or before with the same settings, mesh and code."""
    mesh, folder = mesh_io.load(file), FIELDS / file.stem
    identity = provenance.fingerprint([section.recipe()], [file], "ddf.fit.fitting")
    done = folder / DONE
    if not (done.exists() and storage.read_json(done).get("fingerprint") == identity):
        fitting.fit(mesh, section, folder, {file.name: storage.checksum(file)})
        storage.write_json(done, {"fingerprint": identity})
    return Fitted(file, mesh, folder, UP.get(file.suffix, "y"), section.loop.threads)


def fit_apart(files: Sequence[Path], section: fit_settings.FitConfig, at_once: int) -> list[Path]:
    """The files whose field is there after all were fitted, each in a process of its own; the others are named."""
    given = ["--fit-only", "--minutes", str(section.minutes), "--threads", str(section.loop.threads)]
    commands = {file.name: side_by_side.command(NAME, str(file.parent), "--only", file.stem, *given) for file in files}
    failed = side_by_side.run(commands, at_once)
    for name in failed:
        sys.stderr.write(f"{name}: left out: its fit failed\n")
    return [file for file in files if file.name not in failed]


def row_of(item: Fitted) -> dict[str, Any]:
    """Of the table: threads, steps, seconds, the twelve held-out figures, angles of normals in degrees."""
    result = storage.read_json(item.folder / fitting.METRICS)
    held_out = result["held_out"]
    figures = {**fit_curves.errors(held_out), "normal_angle_deg_p95": held_out["normal_angle_deg_p95"]}
    known = {"mesh": item.file.name, "triangles": len(item.mesh.faces), "threads": item.threads}
    return {**known, "steps": result["steps"], "seconds": result["seconds"], **figures}


def pictures(item: Fitted, size: int) -> picture_strips.StripRow:
    """Depth and normals of the field and of its mesh, from both cameras that stand outside."""
    shape, row = shape_field.load(item.folder), row_of(item)
    cells: list[picture_strips.Picture | None] = []
    for view in shape_views.render(shape, item.mesh, size, item.up, seed=0)[: len(shape_views.OUTSIDE)]:
        images = view.images
        depth, true_depth = field_pictures.depth_pictures(images["depth"], images["true_depth"])
        normals = field_pictures.normals_picture(images["normals"], images["visibility"])
        true_seen = np.isfinite(images["true_depth"]).astype(np.float64)
        cells += [depth, true_depth, normals, field_pictures.normals_picture(images["true_normals"], true_seen)]
    lines = [
        f"{row['triangles']:,} triangles",
        f"A: {row['depth_l1_x10_A']:.2f}",
        f"normals {row['normal_angle_deg_median']:.0f}°",
    ]
    return picture_strips.StripRow(item.file.stem[:14], lines, cells)


def main(given: Sequence[str]) -> None:
    """Fit what is missing, then write sheet and table; a mesh that cannot be fitted is named and left out."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=measuring.REAL_MESHES, help="of meshes")
    parser.add_argument("--minutes", type=float, help="of each fit (default: that of configs/fit.yaml)")
    parser.add_argument("--only", nargs="+", metavar="MESH", help="stems of some meshes")
    parser.add_argument("--out", type=Path, default=OUT)
    parser.add_argument("--fit-only", action="store_true", help="write no sheet")
    side_by_side.add_options(parser)
    arguments = parser.parse_args(given)
    section = config.load(CONFIG, "fit", fit_settings.FitConfig)
    minutes = section.minutes if arguments.minutes is None else arguments.minutes
    section = side_by_side.budgeted(section, minutes, side_by_side.threads(arguments, section.loop.threads))
    files = [file for file in everyday(arguments.folder) if not arguments.only or file.stem in arguments.only]
    if arguments.side_by_side > 1:
        files = fit_apart(files, section, arguments.side_by_side)
    items = []
    for file in files:
        try:
            items.append(fitted(file, section))
        except checks.InputError as error:
            sys.stderr.write(f"{file.name}: left out: {error}\n")
    if not items:
        raise checks.InputError(f"{arguments.folder}: no mesh of it was fitted")
    if arguments.fit_only:
        return
    rows = [pictures(item, section.page.picture_size) for item in items]
    storage.write_bytes(arguments.out / SHEET, picture_strips.strip(COLUMNS, rows))
    table = pd.DataFrame([row_of(item) for item in items])
    storage.write_text(arguments.out / TABLE, table.to_csv(index=False, lineterminator="\n", float_format="%.5g"))
    print(arguments.out / SHEET)
