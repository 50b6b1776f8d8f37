"""The figure of the six sample types: its table is against the closed form of the sphere."""

from ddf_lab.figures import figure_fields, sample_figure
from ddf_lab.report.pages import Table


def test_samples_of_a_sphere_are_those_of_the_closed_form(tmp_path):
    section = sample_figure.section(figure_fields.FiguresConfig(picture_size=24), tmp_path)
    (table,) = (block for block in section.blocks if isinstance(block, Table))
    rows = {str(row[0]): [str(cell) for cell in row[1:]] for row in table.rows}
    assert list(rows) == list("UABSTO")
    assert all(float(cells[1]) < 2e-2 for cells in rows.values() if cells[1] != "–")
    assert float(rows["S"][2]) > 99 and float(rows["A"][0]) > 99  # S starts on the surface, A looks at it
