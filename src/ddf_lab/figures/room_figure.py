"""A room of five planes with the rabbit in it: two fields composed. [DDF22] §4.1, fig. `simpleroom`.

The camera comes from outside, enters the room, and ends within the rabbit, whose inside the field knows too. Truth:
rays cast against the mesh. Composed by the nearest field, and by the paper's softmax, whose η_T it does not give.
"""

import dataclasses
from collections.abc import Mapping
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
SOFT = (0.05, 0.5)  # η_T; the first is drawn
_NEAR_EDGE = 0.1  # of the room whose side is 2
_ASKED = ("visibility", "depth", "normals")


def section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """Pictures of the flight, and errors by region."""
    composite = composed(*(figure_fields.fitted(name, config, folder) for name in ("room", "rabbit")))
    soft = [dataclasses.replace(composite, blend=scene_field.Blend(each)) for each in SOFT]
    ways = {"nearest": composite} | {f"softmax, η_T = {each:g}": way for each, way in zip(SOFT, soft, strict=True)}
    truth, size = raycast.Scene(showcase.furnished(*STAND)), config.picture_size
    looks = scene_field.fly(FLIGHT, FRAMES)
    hits = [raycast.cast(truth, rays.OrientedPoints(*look.rays(size))) for look in looks]
    exact = [_normals({"normals": each.normals, "visibility": each.visible.astype(float)}) for each in hits]
    rows = [
        picture_strips.StripRow("nearest field", ("normals",), [view(composite, look, size) for look in looks]),
        picture_strips.StripRow("softmax", (f"η_T = {SOFT[0]:g}",), [view(soft[0], look, size) for look in looks]),
        picture_strips.StripRow("exact", ("rays cast against the mesh",), exact),
    ]
    figure = pages.Figure(
        "room.webp",
        "The camera enters the room and ends within the rabbit. Colours are normals.",
        "Six cameras on a way into a room and into a rabbit: nearest field, the paper's softmax, exact",
        picture_strips.strip([f"camera {i + 1}" for i in range(FRAMES)], rows, per_line=FRAMES),
    )
    answer = "Answers [DDF22] fig. `simpleroom`."
    return pages.Section("A room and a rabbit", [figure, _errors(ways, truth), answer])


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


def _errors(ways: Mapping[str, scene_field.SceneField], truth: raycast.Scene) -> pages.Table:
    """Of each composition over the rays of a denser flight, by what is met. The first ten triangles are the walls."""
    views = [look.rays(48) for look in scene_field.fly(FLIGHT, 3 * FRAMES)]
    points = rays.OrientedPoints(*(np.concatenate(each) for each in zip(*views, strict=True)))
    hits = raycast.cast(truth, points)
    on = hits.visible & (hits.face < 10)
    at = rays.surface_points(points.positions, points.directions, np.where(hits.visible, hits.depth, 0.0))
    edges = (np.abs(at) > 1 - _NEAR_EDGE).sum(axis=1) >= 2
    rows = []
    for way, composite in ways.items():
        found, _ = beside.ask(composite, lambda _: hits, points, _ASKED)
        for met, chosen in (("walls", on & ~edges), ("near edges", on & edges), ("rabbit", hits.visible & ~on)):
            off = beside.errors({name: own[chosen] for name, own in found.items()})
            depths = [f"{off[name]:.4f}" for name in ("median", "mean")]
            rows.append([way, met, *depths, f"{off['angle']:.1f}", f"{100 * off['wrong']:.1f}"])
    return pages.Table(
        "Median and mean |depth - exact| and median angle where both see a surface, and the share that the field does"
        f" not see, over {len(at):,} rays of the flight; the room's side is 2. `near edges`: hits on walls within"
        f" {_NEAR_EDGE} of where two meet. Softmax: ε_s = {scene_field.Blend(1.0).inverse_depth}; the paper gives"
        " neither that nor η_T.",
        ["composed by", "what is met", "depth", "mean", "normals, °", "unseen, %"],
        rows,
        labels=2,
    )
