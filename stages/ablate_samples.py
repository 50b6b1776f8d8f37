"""Fit the shape of `fit_shape` once without each sample type and once with all: ablate_samples.csv."""

from ddf.core import provenance, storage
from ddf.fit import fit_settings
from ddf_lab.engine import stage
from ddf_lab.evaluation import shape_fits
from ddf_lab.run import Run


@stage.main()
def make(run: Run) -> None:
    fit = run.section(fit_settings.FitConfig)
    out_dir = run.folder("ablate_samples")
    mesh, source = shape_fits.source_mesh(fit.mesh, fit.loop.seed)
    results = shape_fits.leave_one_out(mesh, fit, out_dir, source)
    sources = [out_dir / shape_fits.RESULTS]
    record = provenance.record([fit], fit.loop.seed, sources, shape_fits)
    storage.save_table(out_dir / shape_fits.ABLATION, shape_fits.ablation_table(results), record)
