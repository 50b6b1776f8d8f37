"""Stage `figures`: the paper's figures remade, with numbers against exact values, in artifacts/<experiment>/report."""

from ddf_lab.engine import stage
from ddf_lab.figures import figure_fields, figures_page
from ddf_lab.run import Run


@stage.main()
def make(run: Run) -> None:
    """Fit what is missing and write the page."""
    figures = run.section(figure_fields.FiguresConfig)
    figures_page.write(figures, run.folder("figures") / "fields", run.page)
