"""Stage `report`: tables, figures and a Markdown page in artifacts/<experiment>/report."""

from ddf_lab.engine import stage
from ddf_lab.report import experiment_page
from ddf_lab.run import Run


@stage.main()
def make(run: Run) -> None:
    experiment_page.write(run, run.page)
