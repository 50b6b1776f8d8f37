"""Pictures: test images of every category with what both models make of them."""

from ddf_lab.report.experiment import seed_notes
from ddf_lab.report.experiment.stage_results import Results
from ddf_lab.report.pages import Block, Figure, Section

_CAPTION = "{category}: rows by the error of DDF, then by the difference between the models."
_ALT = "{category}: input, visibility, depth, normals, clouds of DDF and PC-SIREN and true cloud of several test images"
_READING = (
    "Rows are chosen from {count} test images of each category.",
    "From the smallest to the largest D<sub>C</sub> of DDF at the true camera (L points).",
    "Then from the image where DDF is farthest ahead of PC-SIREN to the one where it is farthest behind.",
    "Predictions are seen from the predicted camera at the predicted scale, the truth from the true camera.",
    "Visibility: dark is seen. Depth: yellow is near. Normals: (n + 1)/2 as RGB. Clouds: colour is the place.",
)


def section(results: Results) -> Section:
    """A strip per category."""
    blocks: list[Block] = []
    for category, strip in results.strips.items():
        caption = seed_notes.of_first(results, _CAPTION.format(category=category.capitalize()))
        blocks.append(Figure(f"strip_{_file(category)}.webp", caption, _ALT.format(category=category), strip))
    blocks += (
        [tuple(text.format(count=results.rendered) for text in _READING)]
        if blocks
        else ["No image was rendered (pointclouds.rendered is 0)."]
    )
    return Section("Pictures", blocks)


def _file(group: str) -> str:
    return group.replace(" ", "_")
