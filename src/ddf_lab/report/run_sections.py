"""Sections of one run: pictures, cameras, training, data, times and what does not reproduce."""

import dataclasses
import os
from collections.abc import Mapping
from typing import Any

from ddf.core import config, schema
from ddf.metrics.camera_errors import ERRORS
from ddf_lab.evaluation import groups, scoring
from ddf_lab.report import figures, scores
from ddf_lab.report.pages import Block, Figure, Section, Table
from ddf_lab.report.stage_results import Results

SECTIONS = ("train", "ddf", "pcsiren", "ddf_image", "meshes", "samples", "pointclouds")  # whose settings are compared
_PREDICTED = (
    (scoring.DDF, "Pi_pred"),
    (scoring.DDF, "Pi_corrected"),
    (scoring.PC_SIREN, "Pi_pred"),
    (scoring.DDF_IMAGE, "Pi_pred"),
    (scoring.DDF_IMAGE, "Pi_corrected"),
)
_AZIMUTH, *_OTHERS = ((f"{name}_median", (error.label, error.digits)) for name, error in ERRORS.items())
_TURNED = ("azimuth_turned_x100", (f"azimuth > {scoring.TURNED_DEG:.0f}°, % of images", 0))
_CAMERA_METRICS = dict((_AZIMUTH, _TURNED, *_OTHERS, (scoring.OVERLAP, ("IoU of the silhouette, mean", 2))))
_OWN = "Real shapes are, or are among them, your own, which `ddf shapes add` looked over."
_PROCEDURAL = "Procedural shapes are made by this project in ShapeNet's layout with the same cameras."
_REAL = "Real shapes are of Debian's archive, few and of few makers, rendered by this project as procedural ones are."
_COMPARE = "Scores compare the methods on these shapes; they do not reproduce the paper's ShapeNet numbers."


def pictures_section(results: Results) -> Section:
    """A strip of test images per category with what the models make of them."""
    if not results.strips:
        return Section("Pictures", ["No image was rendered (pointclouds.rendered is 0)."])
    blocks: list[Block] = [
        Figure(
            f"strip_{category.replace(' ', '_')}.webp",
            f"{category.capitalize()}, predicted camera: the picture, and what each model makes of it.",
            f"{category}: several test images and what the models make of them",
            strip,
        )
        for category, strip in results.strips.items()
    ]
    reading = (
        f"Rows are chosen from {results.rendered} test images of each category by D<sub>C</sub> × 1000 of DDF "
        "(predicted camera, L points), which stands over them. Where the azimuth is off, the cloud is turned.",
        "Predictions are seen from the predicted camera at the predicted scale, the truth from the true camera. "
        "Visibility: dark is seen. Depth: yellow is near. Normals: (n + 1)/2 as RGB. Clouds: colour is the place.",
    )
    return Section("Pictures", [*blocks, reading])


def cameras_section(results: Results) -> Section:
    """Median errors of predicted and corrected cameras and of the estimated scale; how many cameras are far off."""
    lines = [
        scores.Line(
            f"{scores.METHOD_LABELS[method]}, {scores.CAMERA_LABELS[camera]}",
            [((method, camera), metric, digits) for metric, (_, digits) in _CAMERA_METRICS.items()],
        )
        for method, camera in _PREDICTED
    ]
    caption = (
        "Median absolute errors over test images, before (Π̂) and after (Π̂<sub>∇</sub>) the correction by the mask. "
        f"More than {scoring.TURNED_DEG:.0f}° off, front is taken for rear."
    )
    header = ["", *(label for label, _ in _CAMERA_METRICS.values())]
    return Section("Cameras", [scores.table(results, results.groups, lines, header, caption)])


def training_section(results: Results) -> Section:
    """Loss curves and the wall time that each model got."""
    curves = Figure(
        "losses.svg",
        "Total loss (thick, smoothed) and its terms without their weights. What may be below 0 is drawn higher by 1. "
        "The models minimise different losses: compare within one model only.",
        "falling curves of the total loss and of its terms over the steps, by model and category",
        figures.loss_curves({model: logs[0] for model, logs in results.logs.items()}).encode(),
    )
    return Section("Training", [curves, budget(results)])


def budget(results: Results) -> str:
    """The wall time that each model trained for, over all categories: of its fastest training, as others may have had
    company.
    """
    seconds = {
        model: min(sum(float(log["seconds"].iloc[-1]) for log in own.values()) for own in logs)
        for model, logs in results.logs.items()
    }
    spent = ", ".join(f"{model} {duration(value)}" for model, value in seconds.items())
    fastest = f", of the fastest of {results.seeds} trainings" if results.seeds > 1 else ""
    return f"Wall time of the trainings, summed over categories{fastest}: {spent}."


def data_section(results: Results) -> Section:
    """Counts of shapes and of the points of the true clouds, which shapes were left out, and whose the shapes are."""
    rows = []
    for group, category in results.groups.items():
        tests = results.shapes[results.shapes["category"] == group]
        trained = list(groups.of_shapes(results.index, category, "train").values()).count(group)
        hidden = f"{100 * tests['hidden_share'].mean():.1f}"
        rows.append([group, str(trained), str(len(tests)), f"{tests['points'].median():,.0f}", hidden])
    caption = (
        "Shapes, and the true clouds of the test shapes. Hidden: no ray from outside meets the point first. Hidden "
        "points count, as in Pixel2Mesh."
    )
    header = ["", "train shapes", "test shapes", "points, median", "hidden, %"]
    failures, seen = results.failures.to_dict("records"), results.settings["dataset"].rows()
    blocks = [
        Table(caption, header, rows),
        f"{len(failures)} shapes were left out:" if failures else "No shape was left out.",
        tuple(f"`{row['id']}` ({row['stage']}): {row['reason']}" for row in failures),
        "Makers of the real shapes, by licence:" if seen else None,
        tuple(groups.makers(seen)),
    ]
    return Section("Data", blocks)


def costs_section(results: Results) -> Section:
    """Times of the stages, and their sum."""
    known = {name: seconds for name, seconds in results.stage_seconds.items() if seconds is not None}
    rows = [[name, duration(known[name]) if name in known else "not timed"] for name in results.stage_seconds]
    rows.append(["together", duration(sum(known.values())) if known else scores.NOTHING])
    caption = f"Each stage's last run, its categories added up, though they run side by side on {os.cpu_count()} CPUs."
    return Section("Times", [Table(caption, ["stage", "time"], rows)])


def duration(seconds: float) -> str:
    """Seconds, minutes or hours, whichever reads best."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.1f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def limits_section(results: Results) -> Section:
    """What does not reproduce: the limits of the experiment, and the settings that are not the paper's."""
    changed, own = changed_settings(results)
    dataset = results.settings["dataset"]
    made = [*dataset.made, *(["own"] if dataset.own else [])]
    facts = {"public": _REAL, "own": _OWN, "synthetic": _PROCEDURAL}
    limits = [*(said for source, said in facts.items() if source in made), *([_COMPARE] if made else [])]
    if results.seeds > 1:
        limits.append(f"{results.seeds} seeds were trained, all on the same data set and samples.")
    else:
        limits.append("One seed was trained: standard errors in [si3dr.csv](si3dr.csv) are over images.")
    blocks = [
        tuple(limits),
        Table("Settings that differ from the paper's.", ["", "here", "paper"], changed) if changed else None,
        f"The paper does not give {', '.join(own)}." if own else None,
    ]
    return Section("What does not reproduce", blocks)


def changed_settings(results: Results) -> tuple[list[tuple[str, str, str]], list[str]]:
    """Key, value here and what the paper prints, with its place, of every setting that is not the paper's; then keys
    of those that the paper does not give.
    """
    changed, own, whole = [], [], "none"
    for name in SECTIONS:
        for each in schema.listed(results.settings[name], name):
            if each.key.startswith(f"{whole}."):
                continue
            if dataclasses.is_dataclass(each.value):
                if each.default is not None:
                    continue  # its settings follow
                whole = each.key  # a part that the paper has not is one line
            if not each.source:
                own.append(f"`{each.key}`")
            elif each.value != each.default:
                changed.append((f"`{each.key}`", _printed(each.value), f"{_printed(each.default)} ({each.source})"))
    return changed, own


def _printed(value: Any) -> str:
    if value is None:
        return "none"
    if dataclasses.is_dataclass(value) or isinstance(value, Mapping):
        items = value.items() if isinstance(value, Mapping) else config.plain(value).items()
        return ", ".join(f"{name} {own}" for name, own in items)
    if isinstance(value, list | tuple):
        return ", ".join(map(str, value)) or "none"
    return str(value)
