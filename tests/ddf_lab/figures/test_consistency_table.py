"""The table of consistency losses: its lines hold the numbers of a fit under the right headings."""

from _shapes import icosphere
from _tiny_fits import TINY

from ddf.data.samples import sample_types
from ddf.fields import shape_field
from ddf.fit import field_diagnostics, fitting
from ddf_lab.figures import consistency_table, figure_fields


def test_lines_are_those_of_the_fit_and_of_its_residuals(tmp_path):
    fit = fitting.fit(icosphere(2), TINY, tmp_path)
    found = field_diagnostics.measure(shape_field.load(tmp_path), 200)
    errors = consistency_table.error_line("none", fit["held_out"])
    residuals = consistency_table.residual_line("none", fit, found)
    assert errors[0] == residuals[0] == "none"
    assert [float(cell) for cell in errors[1:7]] == [round(fit["held_out"]["depth_l1"][kind], 4) for kind in "UABSTO"]
    assert float(errors[7]) == round(fit["held_out"]["normal_angle_deg_median"], 2)
    assert float(residuals[1]) == round(found["view_visibility"]["p95"], 4)
    assert float(residuals[2]) == round(found["view_depth"]["p95"], 4)
    assert float(residuals[4]) == round(fit["held_out"]["visibility_bce"]["U"], 3)


def test_a_field_is_trained_further_in_small_steps_on_all_six_types():
    settings = consistency_table.further(figure_fields.FiguresConfig(steps=10, consistency_steps=7))
    assert settings.steps == 7 and settings.loop.muon is None
    assert [kind for kind, _ in settings.samples.items()] == list(sample_types.KINDS) == list("UABSTO")
