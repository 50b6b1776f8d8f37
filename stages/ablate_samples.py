"""Fit the shape of `fit_shape` once without each sample type and once with all: ablate_samples.csv."""

from ddf.core import provenance, storage
from ddf.fit import fit_settings
from ddf_lab.engine import stage
from ddf_lab.evaluation.shape import fit_errors, leave_one_out, source_mesh
from ddf_lab.run import Run


@stage.main()
def make(run: Run) -> None:
    """Fit seven fields, each within the budget of `fit.ablation`, and write their held-out errors."""
    fit = run.section(fit_settings.FitConfig)
    out_dir = run.folder("ablate_samples")
    mesh, source = source_mesh.read(fit.mesh, fit.loop.seed)
    results = leave_one_out.run(mesh, fit, out_dir, source)
    sources = [out_dir / leave_one_out.RESULTS]
    record = provenance.record([fit], fit.loop.seed, sources, fit_errors)
    storage.save_table(out_dir / fit_errors.ABLATION, fit_errors.ablation_table(results), record)
