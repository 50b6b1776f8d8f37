"""What the stage `fit_shape` writes beside the field: errors, diagnostics and pictures."""

from pathlib import Path

from ddf.core import provenance, storage
from ddf.fields import model_files, shape_field
from ddf.fit import field_diagnostics, fit_settings, fitting
from ddf.geometry import mesh_io
from ddf_lab.evaluation.shape import fit_errors
from ddf_lab.report.shape import shape_views

VIEWS, SLICES, VIEW_RECORD, DIAGNOSTICS = "views.webp", "slices.webp", "views.json", "diagnostics.json"
PICTURE_SIZE, RAYS = 168, 20_000  # pixels a side; random rays that the diagnostics are over


def write(mesh: mesh_io.Mesh, fit: fit_settings.FitConfig, out_dir: Path) -> None:
    """fit.csv, diagnostics.json, views.webp, slices.webp and views.json of the field in `out_dir`.

    Args:
      mesh: in its own frame, the one that was fitted.
    """
    shape = shape_field.load(out_dir)
    held_out = storage.read_json(out_dir / fitting.METRICS)["held_out"]
    model, seed = out_dir / model_files.MODEL, fit.loop.seed
    record = provenance.record([fit], seed, [model], __name__)
    storage.save_table(out_dir / fit_errors.FIT, fit_errors.fit_table(held_out), record)
    storage.write_json(out_dir / DIAGNOSTICS, field_diagnostics.measure(shape, RAYS, seed))
    views = shape_views.render(shape, mesh, PICTURE_SIZE, seed)
    storage.write_bytes(out_dir / VIEWS, shape_views.view_strip(views))
    storage.write_bytes(out_dir / SLICES, shape_views.slice_strip(shape, mesh, PICTURE_SIZE))
    storage.write_json(out_dir / VIEW_RECORD, [view.summary() for view in views])
