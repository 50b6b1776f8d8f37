"""Fit the shape of `fit_shape` once without each sample type and once with all: ablate_samples.csv."""

from pathlib import Path

from ddf import config, provenance, sample_ablation, shape_errors, shape_mesh, single_shape, stage, storage


def run(config_path: Path) -> None:
    """Fit seven fields, each within the budget of `fit.ablation`, and write their held-out errors."""
    fit = config.load(config_path, "fit", single_shape.FitConfig)
    out_dir = config.artifact_dir(config_path, "ablate_samples")
    mesh, source = shape_mesh.read(fit.mesh, fit.loop.seed)
    results = sample_ablation.run(mesh, fit, out_dir, source)
    sources = [out_dir / sample_ablation.RESULTS]
    record = provenance.record(provenance.fingerprint([fit], sources, shape_errors), fit.loop.seed, sources)
    storage.save_table(out_dir / shape_errors.ABLATION, shape_errors.ablation_table(results), record)


if __name__ == "__main__":
    stage.main(run, __doc__)
