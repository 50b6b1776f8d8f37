"""Stage `figures`: the figures of the paper remade, with numbers against exact values, in reports/<experiment>/."""

from pathlib import Path

from ddf.core import config
from ddf_lab.engine import stage
from ddf_lab.figures import figure_fields, figures_page


def run(config_path: Path) -> None:
    """Fit what is missing and write the page."""
    figures = config.load(config_path, figure_fields.FiguresConfig)
    fields = config.artifact_dir(config_path, "figures") / "fields"
    figures_page.write(figures, fields, Path("reports") / config_path.stem)


if __name__ == "__main__":
    stage.main(run, __doc__)
