"""Fit one field to one shape, as it is: the mesh of the config, or a procedural chair."""

from pathlib import Path

from ddf import config, mesh_io, seeding, single_shape, stage, storage
from ddf.synthetic import assemble, chairs


def run(config_path: Path) -> None:
    """Read or make the mesh, fit it, write field, log and held-out errors."""
    fit = config.load(config_path, "fit", single_shape.FitConfig)
    out_dir = config.artifact_dir(config_path, "fit_shape")
    if fit.mesh is None:
        random = seeding.generator(fit.loop.seed, "fit_shape")
        shape = assemble.shape(chairs.build(random), random)
        single_shape.fit(mesh_io.Mesh(shape.vertices, shape.triangles), fit, out_dir)
    else:
        path = Path(fit.mesh)
        single_shape.fit(mesh_io.load(path), fit, out_dir, {path.name: storage.checksum(path)})


if __name__ == "__main__":
    stage.main(run, __doc__)
