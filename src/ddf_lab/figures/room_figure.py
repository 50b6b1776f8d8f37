"""A room of five planes with the rabbit in it: two fields composed. [DDF22] §4.1, fig. `simpleroom`.

The camera comes from outside, enters the room, and ends within the rabbit, whose inside the field knows too. Truth:
rays cast against the mesh.
"""

from pathlib import Path

import numpy as np

from ddf.data.synthetic import showcase
from ddf.fields import framed_field, scene_field
from ddf.geometry import raycast, rays, transforms
from ddf.pictures import field_pictures, picture_strips
from ddf_lab.figures import figure_fields
from ddf_lab.report import beside, pages

STAND = (0.5, (0.0, -0.74, 0.0))  # scale and place of the rabbit in the room: its feet are on the floor
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
    composite = composed(*(figure_fields.fitted(name, config, folder) for name in ("room", "rabbit")))
    truth, size = raycast.Scene(showcase.furnished(*STAND)), config.picture_size
    looks = scene_field.fly(FLIGHT, FRAMES)
    hits = [raycast.cast(truth, rays.OrientedPoints(*look.rays(size))) for look in looks]
    exact = [_normals({"normals": each.normals, "visibility": each.visible.astype(float)}) for each in hits]
    rows = [
        picture_strips.StripRow("two fields composed", ("normals",), [view(composite, look, size) for look in looks]),
        picture_strips.StripRow("exact", ("rays cast against the mesh",), exact),
    ]
    figure = pages.Figure(
        "room.webp",
        "The camera enters the room and ends within the rabbit. Colours are normals. Composed: the nearest field's "
        "answer, not the paper's softmax.",
        "Six cameras on a way into a room and into a rabbit: composite, exact",
        picture_strips.strip([f"camera {i + 1}" for i in range(FRAMES)], rows, per_line=FRAMES),
    )
    answer = "Answers [DDF22] fig. `simpleroom`."
    return pages.Section("A room and a rabbit", [figure, _errors(composite, truth), answer])


def composed(room: framed_field.FramedField, rabbit: framed_field.FramedField) -> scene_field.SceneField:
    """Both where they stand."""
    scale, place = STAND
    stands = (transforms.Similarity(), transforms.Similarity(scale, np.eye(3), np.array(place)))
    return scene_field.SceneField((room, rabbit), stands, np.full(3, -1.05), np.full(3, 1.05))


def view(field: framed_field.FramedField, look: scene_field.LookAt, size: int) -> picture_strips.Picture:
    """Normals that a camera sees."""
    return _normals(framed_field.query(field, rays.OrientedPoints(*look.rays(size)), _ASKED)[0])


def _normals(found: dict[str, np.ndarray]) -> picture_strips.Picture:
    return field_pictures.picture("normals", beside.images(found))


def _errors(composite: scene_field.SceneField, truth: raycast.Scene) -> pages.Table:
    """Medians over the rays of a denser flight, by what is met. The first ten triangles are the walls."""
    views = [look.rays(48) for look in scene_field.fly(FLIGHT, 3 * FRAMES)]
    points = rays.OrientedPoints(*(np.concatenate(each) for each in zip(*views, strict=True)))
    hits = raycast.cast(truth, points)
    found, _ = beside.ask(composite, lambda _: hits, points, _ASKED)
    on = hits.visible & (hits.face < 10)
    at = rays.surface_points(points.positions, points.directions, np.where(hits.visible, hits.depth, 0.0))
    edges = (np.abs(at) > 1 - _NEAR_EDGE).sum(axis=1) >= 2
    rows = []
    for met, chosen in (("walls", on & ~edges), ("near edges", on & edges), ("rabbit", hits.visible & ~on)):
        off = beside.errors({name: own[chosen] for name, own in found.items()})
        rows.append([met, f"{off['median']:.4f}", f"{off['angle']:.1f}", f"{100 * off['wrong']:.1f}"])
    return pages.Table(
        "Median |depth - exact| and angle where both see a surface, and the share that the field does not see, over"
        f" {len(at):,} rays of the flight; the room's side is 2. `near edges`: hits on walls within {_NEAR_EDGE} of"
        " where two meet.",
        ["what is met", "depth", "normals, °", "unseen, %"],
        rows,
    )
