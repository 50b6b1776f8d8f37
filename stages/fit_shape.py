"""Fit one field to one shape, as it is: the mesh of the config, or a procedural chair."""

from pathlib import Path

from ddf import config, shape_mesh, shape_results, single_shape, stage


def run(config_path: Path) -> None:
    """Read or make the mesh, fit it; write field, log, held-out errors, diagnostics and pictures."""
    fit = config.load(config_path, "fit", single_shape.FitConfig)
    out_dir = config.artifact_dir(config_path, "fit_shape")
    mesh, source = shape_mesh.read(fit.mesh, fit.loop.seed)
    single_shape.fit(mesh, fit, out_dir, source)
    shape_results.write(mesh, fit, out_dir)


if __name__ == "__main__":
    stage.main(run, __doc__)
