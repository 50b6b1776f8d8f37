"""Stage `report_shape`: the page on a single shape, in artifacts/<experiment>/report."""

from ddf.fit import fit_settings
from ddf_lab.engine import stage
from ddf_lab.report import shape_page
from ddf_lab.run import Run


@stage.main()
def make(run: Run) -> None:
    shape_page.write(run, run.section(fit_settings.FitConfig))
