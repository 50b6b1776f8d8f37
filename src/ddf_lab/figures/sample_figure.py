"""The six sample types on a sphere, and oriented points that hit and miss. [DDF22] figs. 1 and `datatypes`.

Dots are positions p, thin lines run to what is met; red lines are short looks along v where nothing is.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float
from PIL import Image, ImageDraw

from ddf.data.samples import sample_types
from ddf.data.synthetic import showcase
from ddf.fit import fit_settings, shape_samples
from ddf.geometry import cameras
from ddf.pictures import picture_strips
from ddf_lab.figures import figure_fields
from ddf_lab.report import pages

SHOWN = 90  # of each type
_CAMERA = (0.6, 0.35, 1.25)  # azimuth and elevation in radians, radius, of a sphere of the benchmark's size
_SIZE = 0.27  # of the sphere's radius, in the unit of that camera
_LOOK = 0.5  # length of the line of a miss, field units
_HIT, _MISS, _TO = (31, 95, 168), (30, 30, 30), (90, 180, 190)
_RED, _FAINT, _OVERSAMPLING = (205, 60, 50), (222, 226, 232), 3


def section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """A cell per type, and what the samples of a unit sphere are, against the closed form."""
    ball = showcase.ball(1.0, 5)
    counts = sample_types.each(4000)
    samples, _ = shape_samples.draw_samples(ball, fit_settings.FitConfig(), counts, "figure")
    cells, rows = [], []
    for kind, arrays in samples.arrays.items():
        part = {name: values.numpy().astype(np.float64) for name, values in arrays.items()}
        cells.append(_picture(part, 2 * config.picture_size))
        rows.append([kind, *_row(part, samples.unit)])
    strip = picture_strips.strip(
        list(samples.arrays), [picture_strips.StripRow("sample types", ("a sphere",), cells)], per_line=3
    )
    return pages.Section(
        "Oriented points that hit and miss: six sample types",
        [
            pages.Figure(
                "samples.webp",
                "Blue: p that sees the sphere, with a line to what it sees. Black: p that does not, with a look along"
                " v.",
                "Samples of the six types on a sphere",
                strip,
            ),
            pages.Table(
                "4,000 samples a type. depth: largest |d - exact| of the samples that see the sphere more squarely than"
                " 0.2 (the mesh has 20,480 triangles and lies up to 5e-4 inside the sphere).",
                [("", 4, False)],
                ["type", "see the sphere, %", "depth", "p on the surface, %"],
                rows,
            ),
            "Answers [DDF22] fig. 1, left, and fig. `datatypes`.",
        ],
    )


def _row(part: dict[str, Float[np.ndarray, "n ..."]], radius: float) -> list[str]:
    """Share that sees, largest depth error against the sphere of the field frame, share on the surface."""
    positions, directions, visible = part["positions"], part["directions"], part["visible"] > 0
    b = (positions * directions).sum(axis=1)
    quarter = b**2 - (positions**2).sum(axis=1) + radius**2
    half = np.sqrt(np.maximum(quarter, 0.0))
    off = np.minimum(np.abs(-b - half - part["depth"]), np.abs(-b + half - part["depth"]))
    square = np.abs((part["normals"] * directions).sum(axis=1)) > 0.2
    on = np.abs(np.linalg.norm(positions, axis=1) - radius) < 2e-3
    known = visible & square
    worst = f"{off[known].max():.1e}" if known.any() else "–"
    return [f"{100 * visible.mean():.1f}", worst, f"{100 * on.mean():.1f}"]


def _picture(part: dict[str, Float[np.ndarray, "n ..."]], size: int) -> picture_strips.Picture:
    """Projected dots and lines, the sphere as a faint disc."""
    side = size * _OVERSAMPLING
    canvas = Image.new("RGB", (side, side), "white")
    draw = ImageDraw.Draw(canvas)
    pose = cameras.extrinsics(*(np.array(value) for value in _CAMERA))
    rim = side * _SIZE / _CAMERA[2] * cameras.FOCAL_PX / cameras.IMAGE_SIZE
    draw.ellipse([side / 2 - rim, side / 2 - rim, side / 2 + rim, side / 2 + rim], fill=_FAINT)

    def place(points: Float[np.ndarray, "n 3"]) -> list[tuple[float, float]]:
        column, row = cameras.project(_SIZE * points, *pose)
        return [(float(x), float(y)) for x, y in np.stack([column, row], -1) * side / cameras.IMAGE_SIZE]

    p, v = part["positions"][:SHOWN], part["directions"][:SHOWN]
    seen = part["visible"][:SHOWN] > 0
    length = np.where(seen, part["depth"][:SHOWN], _LOOK)
    for start, end, hit in zip(place(p), place(p + length[:, None] * v), seen, strict=True):
        draw.line([start, end], fill=_TO if hit else _RED, width=_OVERSAMPLING)
    for (x, y), hit in zip(place(p), seen, strict=True):
        radius = 1.8 * _OVERSAMPLING
        draw.ellipse([x - radius, y - radius, x + radius, y + radius], fill=_HIT if hit else _MISS)
    return np.asarray(canvas.resize((size, size), Image.Resampling.LANCZOS))
