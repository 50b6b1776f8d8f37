"""Fit one field to one shape, as it is: the mesh of the config, or a procedural chair."""

from pathlib import Path

from ddf.core import config
from ddf.fit import fit_settings, fitting
from ddf_lab.engine import stage
from ddf_lab.evaluation.shape import source_mesh
from ddf_lab.report.shape import shape_results


def run(config_path: Path) -> None:
    """Read or make the mesh, fit it; write field, log, held-out errors, diagnostics and pictures."""
    fit = config.load(config_path, fit_settings.FitConfig)
    out_dir = config.artifact_dir(config_path, "fit_shape")
    mesh, source = source_mesh.read(fit.mesh, fit.loop.seed)
    fitting.fit(mesh, fit, out_dir, source, force=True)
    shape_results.write(mesh, fit, out_dir)


if __name__ == "__main__":
    stage.main(run, __doc__)
