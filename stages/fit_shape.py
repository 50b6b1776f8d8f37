"""Fit one field to one shape, as it is: the mesh of the config, or a procedural chair."""

from ddf.fit import fit_settings, fitting
from ddf_lab.engine import stage
from ddf_lab.evaluation import shape_fits
from ddf_lab.report import shape_views
from ddf_lab.run import Run


@stage.main()
def make(run: Run) -> None:
    """Read or make the mesh, fit it; write field, log, held-out errors, diagnostics and pictures."""
    fit = run.section(fit_settings.FitConfig)
    out_dir = run.folder("fit_shape")
    mesh, source = shape_fits.source_mesh(fit.mesh, fit.loop.seed)
    fitting.fit(mesh, fit, out_dir, source, force=True)
    shape_views.write(mesh, fit, out_dir)
