"""Stage `report_generative`: the page on the generative models, as Markdown and HTML, in reports/<experiment>/."""

from pathlib import Path

from ddf.core import config
from ddf.models.generative import settings
from ddf_lab.engine import stage
from ddf_lab.report import generative_page


def run(config_path: Path, category: str) -> None:
    """Read what the stages before left behind and write the page."""
    gan = config.load(config_path, settings.GANConfig)
    scores = config.load(config_path, settings.ScoresConfig)
    generative_page.write(config_path, category, gan, scores, Path("reports") / config_path.stem)


if __name__ == "__main__":
    stage.main(run, __doc__, category=True)
