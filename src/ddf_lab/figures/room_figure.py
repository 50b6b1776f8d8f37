"""A room of five planes with the rabbit in it: two fields composed, beside one field of the whole. [DDF22] §4.1.

The camera comes from outside, enters the room, and ends within the rabbit, whose inside the field knows too
([DDF22] fig. `simpleroom`; the one field of the whole: app. `noncompfiteg`). Truth: rays cast against the mesh.
"""

import dataclasses
from pathlib import Path

import numpy as np

from ddf.fields import framed_field, scene_field
from ddf.geometry import raycast, rays, transforms
from ddf.pictures import field_pictures, picture_strips
from ddf_lab.figures import figure_fields
from ddf_lab.report import beside, pages

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


def section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """Pictures of the flight, and errors by region."""
    room, rabbit, whole = (figure_fields.fitted(name, config, folder) for name in ("room", "rabbit", "furnished"))
    composite, truth = composed(room, rabbit), raycast.Scene(figure_fields.SHAPES["furnished"]())
    looks, rows, size = scene_field.fly(FLIGHT, FRAMES), [], config.picture_size
    for name, field in (("two fields composed", composite), ("one field of twice the width", whole)):
        rows.append(picture_strips.StripRow(name, ("normals",), [view(field, look, size) for look in looks]))
    hits = [raycast.cast(truth, rays.OrientedPoints(*look.rays(size))) for look in looks]
    exact = [_normals({"normals": each.normals, "visibility": each.visible.astype(float)}) for each in hits]
    rows.append(picture_strips.StripRow("exact", ("rays cast against the mesh",), exact))
    figure = pages.Figure(
        "room.webp",
        "The camera enters the room and ends within the rabbit. Colours are normals. Composed: the nearest field's "
        "answer, not the paper's softmax.",
        "Six cameras on a way into a room and into a rabbit: composite, one field, exact",
        picture_strips.strip([f"camera {i + 1}" for i in range(FRAMES)], rows, per_line=FRAMES),
    )
    said = (
        f"The one field has twice the width and twice the samples. Its {config.whole_steps:,} steps cost as much as"
        f" {4 * config.whole_steps:,} of a part; the room has {config.steps:,}, the rabbit 6,000."
    )
    answer = "Answers [DDF22] figs. `simpleroom` and `app:fig:simpleroom2xsl`."
    return pages.Section("A room and a rabbit", [figure, _errors(composite, whole, truth), said, answer])


def composed(room: framed_field.FramedField, rabbit: framed_field.FramedField) -> scene_field.SceneField:
    """Both where they stand."""
    scale, place = figure_fields.STAND
    stands = (transforms.Similarity(), transforms.Similarity(scale, np.eye(3), np.array(place)))
    return scene_field.SceneField((room, rabbit), stands, np.full(3, -1.05), np.full(3, 1.05))


def view(field: framed_field.FramedField, look: scene_field.LookAt, size: int) -> picture_strips.Picture:
    """Normals that a camera sees."""
    return _normals(framed_field.query(field, rays.OrientedPoints(*look.rays(size)), _ASKED)[0])


def _normals(found: dict[str, np.ndarray]) -> picture_strips.Picture:
    return field_pictures.picture("normals", beside.images(found))


def _errors(composite: scene_field.SceneField, whole: framed_field.FramedField, truth: raycast.Scene) -> pages.Table:
    """Medians over the rays of a denser flight, by what is met; the parts alone beside them.

    The first ten triangles are the walls.
    """
    views = [look.rays(48) for look in scene_field.fly(FLIGHT, 3 * FRAMES)]
    points = rays.OrientedPoints(*(np.concatenate(each) for each in zip(*views, strict=True)))
    hits = raycast.cast(truth, points)
    on = hits.visible & (hits.face < 10)
    at = rays.surface_points(points.positions, points.directions, np.where(hits.visible, hits.depth, 0.0))
    edges = (np.abs(at) > 1 - _NEAR_EDGE).sum(axis=1) >= 2
    rabbit = dataclasses.replace(composite, fields=composite.fields[1:], scene_from_mesh=composite.scene_from_mesh[1:])
    both = {"composed": composite, "one field": whole}
    rows = []
    for met, chosen, fields in (
        ("walls", on & ~edges, both | {"room alone": composite.fields[0]}),
        ("near edges", on & edges, both | {"room alone": composite.fields[0]}),
        ("rabbit", hits.visible & ~on, both | {"rabbit alone": rabbit}),
    ):
        asked = rays.OrientedPoints(points.positions[chosen], points.directions[chosen])
        true = rays.RayHits(hits.depth[chosen], hits.visible[chosen], hits.normals[chosen], hits.face[chosen])
        for name, field in fields.items():
            off = beside.errors(beside.ask(field, lambda _, true=true: true, asked, _ASKED)[0])
            rows.append([met, name, f"{off['median']:.4f}", f"{off['angle']:.1f}", f"{100 * off['wrong']:.1f}"])
    return pages.Table(
        "Median |depth - exact| and angle where both see a surface, and the share that the field does not see, over"
        f" {len(at):,} rays of the flight; the room's side is 2. `near edges`: hits on walls within {_NEAR_EDGE} of"
        " where two meet. A part alone is judged where it is what is met.",
        ["what is met", "field", "depth", "normals, °", "unseen, %"],
        rows,
        labels=2,
    )
