"""Synthetic shapes made, or a ShapeNet root checked; either way split and indexed."""

from pathlib import Path

from ddf.core import config
from ddf.data import dataset
from ddf_lab.engine import stage


def run(config_path: Path) -> None:
    """Make or check the data set of an experiment and write its index.json."""
    section = config.load(config_path, dataset.DatasetConfig)
    dataset.write_index(section, config.artifact_dir(config_path, "dataset"))


if __name__ == "__main__":
    stage.main(run, __doc__)
