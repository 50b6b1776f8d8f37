"""A room of five planes with the rabbit in it: two fields composed, beside one field of the whole. [DDF22] §4.1.

The camera comes from outside, enters the room, and ends within the rabbit, whose inside the field knows too
([DDF22] fig. `simpleroom`; the one field of the whole: app. `noncompfiteg`). Truth: rays cast against the mesh.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Bool

from ddf.fields import framed_field, scene_field
from ddf.fields.shape_field import ShapeField
from ddf.geometry import raycast, rays, transforms
from ddf.pictures import field_pictures, picture_strips
from ddf_lab.figures import figure_fields
from ddf_lab.report import pages

ROOM, RABBIT, EDGE = "walls", "rabbit", "near edges"
FLIGHT = tuple(
    scene_field.LookAt(np.array(position), np.array(target))
    for position, target in (
        ((1.6, 1.0, 4.0), (0.0, -0.3, 0.0)),
        ((0.5, 0.2, 1.6), (0.0, -0.4, 0.0)),
        ((0.1, -0.3, 0.9), (0.0, -0.5, 0.0)),
        ((0.0, -0.62, -0.05), (0.0, -0.3, 0.4)),
    )
)
FRAMES = 6
_NEAR_EDGE = 0.1  # of the room whose side is 2
_ASKED = ("visibility", "depth", "normals")


_SCALE, _AT = figure_fields.STAND
_PLACES = (transforms.Similarity(), transforms.Similarity(_SCALE, np.eye(3), np.array(_AT)))  # of room and rabbit
_LOWER, _UPPER = np.full(3, -1.05), np.full(3, 1.05)


def section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """Pictures of the flight, and errors by region."""
    room, rabbit, whole = (figure_fields.fitted(name, config, folder) for name in ("room", "rabbit", "furnished"))
    composite = composed(room, rabbit)
    truth = raycast.Scene(figure_fields.SHAPES["furnished"]())
    looks = scene_field.fly(FLIGHT, FRAMES)
    columns = [f"camera {i + 1}" for i in range(FRAMES)]
    hits = [raycast.cast(truth, _points(look, config.picture_size)) for look in looks]
    rows = []
    for name, field in (("two fields composed", composite), ("one field of twice the width", whole)):
        cells = [view(field, look, config.picture_size) for look in looks]
        rows.append(picture_strips.StripRow(name, ("normals",), cells))
    exact = [{"normals": hit.normals, "visibility": hit.visible.astype(float)} for hit in hits]
    rows.append(picture_strips.StripRow("exact", ("rays cast against the mesh",), [_normals(each) for each in exact]))
    return pages.Section(
        "A room and a rabbit",
        [
            pages.Figure(
                "room.webp",
                "The camera enters the room and ends within the rabbit. Colours are normals.",
                "Six cameras on a way into a room and into a rabbit: composite, one field, exact",
                picture_strips.strip(columns, rows, per_line=FRAMES),
            ),
            _errors(composite, whole, truth),
            f"The one field has twice the width and twice the samples. Its {config.whole_steps:,} steps cost as much as"
            f" {4 * config.whole_steps:,} of a part; the room has {config.steps:,}, the rabbit 6,000.",
            "Answers [DDF22] figs. `simpleroom` and `app:fig:simpleroom2xsl`.",
        ],
    )


def composed(room: framed_field.FramedField, rabbit: framed_field.FramedField) -> scene_field.SceneField:
    """Both where they stand."""
    return scene_field.SceneField((room, rabbit), _PLACES, _LOWER, _UPPER)


def view(field: framed_field.FramedField, look: scene_field.LookAt, size: int) -> picture_strips.Picture:
    """Normals that a camera sees."""
    return _normals(framed_field.query(field, _points(look, size), _ASKED)[0])


def _points(look: scene_field.LookAt, size: int) -> rays.OrientedPoints[np.ndarray]:
    return rays.OrientedPoints(*look.rays(size))


def _normals(found: dict[str, np.ndarray]) -> picture_strips.Picture:
    size = round(len(found["visibility"]) ** 0.5)
    return field_pictures.normals_picture(
        found["normals"].reshape(size, size, 3), found["visibility"].reshape(size, size)
    )


def _errors(composite: scene_field.SceneField, whole: ShapeField, truth: raycast.Scene) -> pages.Table:
    """Medians over the rays of a denser flight, by what is met; the parts alone beside them."""
    looks = scene_field.fly(FLIGHT, 3 * FRAMES)
    every = [_points(look, 48) for look in looks]
    points = rays.OrientedPoints(*(np.concatenate([getattr(p, n) for p in every]) for n in ("positions", "directions")))
    hits = raycast.cast(truth, points)
    regions = _regions(points, hits)
    rows = []
    for name, field in (
        ("composed", composite),
        ("one field", whole),
        ("room alone", composite.fields[0]),
        ("rabbit alone", _placed(composite, 1)),
    ):
        found, _ = framed_field.query(field, points, _ASKED)
        shown = {"room alone": (ROOM, EDGE), "rabbit alone": (RABBIT,)}.get(name, tuple(regions))
        rows += [[region, name, *_cells(found, hits, chosen)] for region, chosen in regions.items() if region in shown]
    rows.sort(key=lambda row: tuple(regions).index(row[0]))
    return pages.Table(
        f"Median |depth - exact| and angle where both see a surface, and the share that the field does not see, over"
        f" {len(points.positions):,} rays of the flight; the room's side is 2. `near edges`: hits on walls within"
        f" {_NEAR_EDGE} of where two meet. A part alone is judged where it is what is met.",
        ["what is met", "field", "depth", "normals, °", "unseen, %"],
        rows,
        labels=2,
    )


def _placed(composite: scene_field.SceneField, index: int) -> scene_field.SceneField:
    """A scene of one of the fields."""
    return scene_field.SceneField(
        (composite.fields[index],), (composite.scene_from_mesh[index],), composite.lower, composite.upper
    )


def _regions(
    points: rays.OrientedPoints[np.ndarray], hits: rays.RayHits[np.ndarray]
) -> dict[str, Bool[np.ndarray, "n"]]:
    """Which rays meet the walls, their edges, the rabbit; the first ten triangles are the walls."""
    on = hits.visible & (hits.face < 10)
    at = points.positions + np.where(hits.visible, hits.depth, 0.0)[:, None] * points.directions
    edges = (np.abs(at) > 1 - _NEAR_EDGE).sum(axis=1) >= 2
    return {ROOM: on & ~edges, EDGE: on & edges, RABBIT: hits.visible & ~on}


def _cells(found: dict[str, np.ndarray], hits: rays.RayHits[np.ndarray], chosen: Bool[np.ndarray, "n"]) -> list[str]:
    both = chosen & np.isfinite(found["depth"])
    off = np.abs(found["depth"][both] - hits.depth[both])
    cosine = (found["normals"][both] * hits.normals[both]).sum(axis=1)
    angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    unseen = 100 * (chosen & ~np.isfinite(found["depth"])).sum() / max(1, chosen.sum())
    return [f"{np.median(off):.4f}", f"{np.median(angle):.1f}", f"{unseen:.1f}"]
