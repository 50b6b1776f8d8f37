"""Cameras: errors of the predicted and of the corrected ones."""

from ddf.metrics.camera_errors import ERRORS
from ddf_lab.evaluation import scoring
from ddf_lab.report.experiment import scores, seed_notes
from ddf_lab.report.experiment.stage_results import Results
from ddf_lab.report.pages import Section, Table

PREDICTED = (
    ("DDF", scoring.DDF, "Pi_pred"),
    ("DDF, corrected", scoring.DDF, "Pi_corrected"),
    ("PC-SIREN", scoring.PC_SIREN, "Pi_pred"),
)
_AZIMUTH, *_OTHERS = ((f"{name}_median", (error.label, error.digits)) for name, error in ERRORS.items())
_TURNED = ("azimuth_turned_x100", (f"azimuth > {scoring.TURNED_DEG:.0f}°, % of images", 0))
_METRICS = dict((_AZIMUTH, _TURNED, *_OTHERS, (scoring.OVERLAP, ("IoU of the silhouette, mean", 2))))
_CAPTION = "Median absolute errors over test images, before (Π̂) and after (Π̂<sub>∇</sub>) the correction by the mask."
_READING = (
    "The scale is estimated from the diagonal of the predicted cloud.",
    "With an azimuth so far off, front is taken for rear, and the descent on the mask ends in another basin.",
)


def section(results: Results) -> Section:
    """The medians of all errors."""
    return Section("Cameras", [table(results), _READING])


def table(results: Results) -> Table:
    """Median errors of predicted and corrected cameras and of the estimated scale; how many cameras are far off."""
    found = scores.Scores(results.table)
    heads = [(method, column) for _, method, column in PREDICTED]
    rows = []
    for category in results.groups:
        for head in heads:
            texts = [found.text(category, head, metric, digits) for metric, (_, digits) in _METRICS.items()]
            label = f"{scores.METHOD_LABELS[head[0]]}, {scores.CAMERA_LABELS[head[1]]}"
            rows.append([category if head == heads[0] else "", label, *texts])
    header = ["", "", *(label for label, _ in _METRICS.values())]
    note = scores.images_note(found, results.groups, heads, next(iter(_METRICS)))
    caption = seed_notes.over_seeds(results, f"{_CAPTION} {note}".strip())
    return Table(caption, header, rows, labels=2)
