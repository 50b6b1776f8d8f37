"""Stage `report_shape`: the page on a single shape, as Markdown and self-contained HTML, in reports/<experiment>/."""

from pathlib import Path

from ddf.core import config
from ddf.fit import fit_settings
from ddf_lab.engine import stage
from ddf_lab.report.shape import shape_page


def run(config_path: Path) -> None:
    """Read what `fit_shape` and `ablate_samples` left behind and write the page."""
    fit = config.load(config_path, fit_settings.FitConfig)
    shape_page.write(config_path, fit, Path("reports") / config_path.stem)


if __name__ == "__main__":
    stage.main(run, __doc__)
