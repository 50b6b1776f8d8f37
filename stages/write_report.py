"""Stage `report`: tables, figures, one Markdown page and one self-contained HTML page in reports/<experiment>/."""

from pathlib import Path

from ddf import config, reports, stage


def run(config_path: Path) -> None:
    """Read what all stages left behind and write the report."""
    settings = config.load(config_path, "report", reports.ReportConfig)
    reports.write(config_path, Path("reports") / config_path.stem, settings)


if __name__ == "__main__":
    stage.main(run, __doc__)
