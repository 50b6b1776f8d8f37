"""Stage `report`: tables, figures, one Markdown page and one self-contained HTML page in reports/<experiment>/."""

from pathlib import Path

from ddf.core import config
from ddf_lab.engine import stage
from ddf_lab.report.experiment import experiment_page


def run(config_path: Path) -> None:
    """Read what all stages left behind and write the report."""
    settings = config.load(config_path, experiment_page.ReportConfig)
    experiment_page.write(config_path, Path("reports") / config_path.stem, settings)


if __name__ == "__main__":
    stage.main(run, __doc__)
