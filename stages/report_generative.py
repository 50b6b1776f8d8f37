"""Stage `report_generative`: the page on generative models, in artifacts/<experiment>/report."""

from ddf.models import generative_settings
from ddf_lab.engine import stage
from ddf_lab.report import generative_page
from ddf_lab.run import Run


@stage.main(category=True)
def make(run: Run) -> None:
    generative_page.write(
        run, run.section(generative_settings.GANConfig), run.section(generative_settings.ScoresConfig)
    )
