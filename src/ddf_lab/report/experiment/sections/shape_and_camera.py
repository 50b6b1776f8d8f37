"""Shape and camera: where the error with a predicted camera comes from."""

from ddf.metrics import metrics
from ddf_lab.evaluation import baselines, scoring
from ddf_lab.report.experiment import scores, seed_notes
from ddf_lab.report.experiment.stage_results import Results
from ddf_lab.report.pages import Section, Table

_METRICS = {"chamfer_l2_sq_x1000": "Chamfer distance", "f_score_tau_x100": "F-score"}
_PLACED = ((scoring.DDF, "Pi_pred-S"), (scoring.DDF, "Pi_corrected-S"), (scoring.PC_SIREN, "Pi_pred-S"))
_PARTS = ("ceiling", "shape", "camera", "sum")
_READING = (
    "Ceiling: the truth against itself.",
    "Shape: what the model adds at the true camera and scale.",
    "Camera: what the predicted camera (Π̂, or Π̂<sub>∇</sub> after descent on the mask) and scale add to that.",
)


def section(results: Results) -> Section:
    """A table per metric."""
    return Section("Shape and camera", [*(table(results, metric) for metric in _METRICS), _READING])


def table(results: Results, metric: str) -> Table:
    """The ceiling's score, what the shape adds and what the camera adds: shape = Π_g - ceiling, camera = Π̂ - Π_g.

    With S points, which is what the corrected camera is evaluated with.
    """
    found = scores.Scores(results.table)
    label, digits = str(metrics.PRINTED[metric].label), metrics.PRINTED[metric].digits
    rows = []
    for category in results.categories:
        for method, column in _PLACED:
            whole, shape, ceiling = (
                found.value(category, head, metric)
                for head in ((method, column), (method, "Pi_g-S"), (baselines.CEILING, "Pi_g-S"))
            )
            cells = [
                scores.number(ceiling, digits),
                scores.difference(shape, ceiling, digits),
                scores.difference(whole, shape, digits),
                scores.number(whole, digits),
            ]
            name = f"{scores.METHOD_LABELS[method]}, {scores.column_label(column)}"
            rows.append([category if not len(rows) % len(_PLACED) else "", name, *cells])
    caption = seed_notes.of_means(results, f"Parts of the {_METRICS[metric]}, S points.")
    layout = [("", 2, False), (label, len(_PARTS), False)]
    return Table(caption, layout, ["", "", *_PARTS], rows, labels=2, rule_every=len(_PLACED))
