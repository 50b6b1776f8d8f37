"""Writes docs/house.svg, the picture of both packages: a room's level is that of tests/test_import_graph.py."""

import html
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from test_import_graph import LEVELS

OUT = Path(__file__).with_suffix(".svg")
ROOMS = {  # what a room holds
    "ddf.core": "checks, files, seeds, configs",
    "ddf.geometry": "rays, cameras, casting, meshes, neighbours",
    "ddf.data": "ShapeNet, other shapes; sample rays are drawn",
    "ddf.fields": "networks, patches, losses, derivatives, rendering; their files",
    "ddf.metrics": "Chamfer distance, F-score, angles, image scores",
    "ddf.pictures": "shading, strips, sheets",
    "ddf.models": "encoders, PC-SIREN, shape VAE, image GANs",
    "ddf.training": "the loop, optimisers, steps of each model",
    "ddf.fit": "one field for one mesh; a whole shape from a scan",
    "ddf.reconstruction": "an image becomes a thing; new shapes",
    "ddf.io": "model files, ONNX, the viewer's page",
    "ddf.api": "import ddf: load, fit, cast, ...",
    "ddf.torch": "rays with gradients, in a loop of one's own",
    "ddf.jax": "the same as functions of JAX",
    "ddf.cli": "the command ddf: a function a command",
    "ddf.__main__": "python -m ddf",
    "ddf_lab.run": "what a stage is given: sections, folders, seed",
    "ddf_lab.evaluation": "the paper's columns, baselines, paired errors",
    "ddf_lab.model_cards": "models that come with the package",
    "ddf_lab.report": "pages and tables of an experiment",
    "ddf_lab.figures": "figures of the paper",
    "ddf_lab.engine": "graph of stages, what is done",
    "ddf_lab.commands": "ddf run, ddf info",
}
SCRIPTS = {"stages/": "a stage begins here; pipeline.yaml wires them", "bench/": "speed against error"}
_WIDE, _HIGH, _GAP, _LEFT, _TEXT = 600, 24, 4, 66, 150
_COLOURS = {"ddf": ("#eaf2fb", "#2b6cb0"), "ddf_lab": ("#fdf1e3", "#b7651b")}
_OTHER = ("#f3f3f3", "#555")


def picture() -> str:
    """One row a room, the lowest level at the bottom; a room imports those below it."""
    rows = [*((room, ROOMS[room]) for room in sorted(ROOMS, key=LEVELS.__getitem__)), *SCRIPTS.items()]
    width, height = _LEFT + _WIDE + _GAP, len(rows) * (_HIGH + _GAP) + _GAP
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
        'font-family="sans-serif" font-size="12" role="img">',
        "<title>Rooms of the packages ddf and ddf_lab by level of import</title>",
        f'<rect width="{width}" height="{height}" fill="white"/>',
    ]
    for row, (room, text) in enumerate(rows):
        top, (fill, line) = height - (row + 1) * (_HIGH + _GAP), _COLOURS.get(room.split(".")[0], _OTHER)
        label = f"level {LEVELS[room]}" if room in LEVELS else "scripts"
        lines += [
            f'<text x="{_GAP}" y="{top + 16}" fill="#666">{label}</text>',
            f'<rect x="{_LEFT}" y="{top}" width="{_WIDE}" height="{_HIGH}" rx="5" fill="{fill}" stroke="{line}"/>',
            f'<text x="{_LEFT + 9}" y="{top + 16}" font-weight="bold" fill="{line}">{room}</text>',
            f'<text x="{_LEFT + _TEXT}" y="{top + 16}" fill="#222">{html.escape(text)}</text>',
        ]
    return "\n".join([*lines, "</svg>\n"])


if __name__ == "__main__":
    OUT.write_text(picture(), encoding="utf-8")
