"""Synthetic shapes made, or a ShapeNet root checked; either way split and indexed."""

from ddf.data import dataset
from ddf_lab.engine import stage
from ddf_lab.run import Run


@stage.main()
def make(run: Run) -> None:
    dataset.write_index(run.section(dataset.DatasetConfig), run.folder("dataset"))
