"""How good the field of a mesh is, beside the mesh itself: numbers with a verdict each, and a picture of both.

Seen by two cameras from outside, and asked inside the box. Lengths are in per cent of the box's longest side. The mesh
is asked like a field, by rays cast at it, so that what draws and measures fields draws and measures the truth.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, UInt8
from PIL import Image, ImageDraw, ImageFont

from ddf.fields import framed_field
from ddf.geometry import mesh_io, raycast, rays, transforms
from ddf.pictures import shaded


@dataclass(frozen=True)
class MeshField:
    """A mesh in the box and the frame of a field (`framed_field.FramedField`)."""

    scene: raycast.Scene
    lower: Float[np.ndarray, "3"]
    upper: Float[np.ndarray, "3"]
    field_from_mesh: transforms.Similarity

    outputs = ("visibility", "depth", "normals")

    def evaluate(
        self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"], outputs: Collection[str]
    ) -> dict[str, Float[np.ndarray, "n ..."]]:
        """Named outputs, field frame, float64; 0 on a miss."""
        back = self.field_from_mesh.inverse()
        asked = rays.OrientedPoints(back.apply(positions), back.apply_directions(directions))
        hits = raycast.cast(self.scene, asked)
        found = {
            "visibility": hits.visible.astype(np.float64),
            "depth": self.field_from_mesh.scale_depth(np.where(hits.visible, hits.depth, 0.0)),
            "normals": self.field_from_mesh.apply_directions(hits.normals),
        }
        return {name: found[name] for name in outputs}


def beside(field: framed_field.FramedField, mesh: mesh_io.Mesh) -> MeshField:
    """The mesh that a field was fitted to, in that field's box and frame."""
    return MeshField(raycast.Scene(mesh), field.lower, field.upper, field.field_from_mesh)


PICTURE = "fit.png"  # beside the field, in its folder
VIEWS = ((35.0, 25.0), (215.0, -15.0))  # azimuth and elevation, degrees
SIZE = 256  # pixels of a picture's side
INSIDE = 20_000  # rays from inside the box
THIN = 0.02  # of the longest side: a part through which a ray goes no further
OFF = 0.01  # of the longest side: from which on the depth of a ray is wrong
_LIFT = 1e-4  # of the longest side: where a ray into the body begins below its surface


@dataclass(frozen=True)
class Measure:
    """What is measured, its unit, and up to where it is good, and fair."""

    words: str
    unit: str
    good: float
    fair: float

    def verdict(self, value: float) -> str:
        """Good, fair or poor; nothing of what is not known."""
        if np.isnan(value):
            return ""
        rising = self.good > self.fair
        within = [value >= bound if rising else value <= bound for bound in (self.good, self.fair)]
        return "good" if within[0] else "fair" if within[1] else "poor"


MEASURES = {
    "depth": Measure("depth, median error", "% of the size", 0.1, 0.5),
    "silhouettes": Measure("silhouettes, overlap with the true ones", "%", 99.0, 97.0),
    "thin": Measure(f"parts thinner than {THIN:.0%} of the size, seen", "%", 95.0, 80.0),
    "normals": Measure("normals, median error", "degrees", 3.0, 10.0),
    "inside": Measure("rays from inside the box, wrong", "%", 2.0, 10.0),
}


def measure(field: framed_field.FramedField, truth: MeshField) -> dict[str, float]:
    """The value of each of `MEASURES`; NaN of what the pictures do not show. The truth is `beside` the field's mesh."""
    size = _size(field)
    seen = [_seen(field, truth, camera, size) for camera in _cameras(field)]
    depth, angle, overlap, thin = map(np.concatenate, zip(*seen, strict=True))
    return {
        "depth": _median(depth),
        "silhouettes": _percent(overlap),
        "thin": _percent(thin),
        "normals": _median(angle),
        "inside": wrong_inside(field, truth),
    }


def picture(field: framed_field.FramedField, truth: MeshField, up: str = "y") -> UInt8[np.ndarray, "h w 3"]:
    """Field above, mesh below, by the same cameras and the same light; each row is named."""
    cameras = _cameras(field, up)
    rows = []
    standing = shaded.stand(truth, up)
    shown = [shaded.window(standing, [camera]) for camera in cameras]
    for name, each in (("field", shaded.Standing(field, up, standing.floor)), ("mesh", standing)):
        tiles = [shaded.render(each, camera, SIZE, part).picture for camera, part in zip(cameras, shown, strict=True)]
        row = Image.fromarray(np.concatenate(tiles, axis=1))
        ImageDraw.Draw(row).text((8, 6), name, fill=(90, 95, 105), font=ImageFont.load_default(18))
        rows.append(np.asarray(row))
    return np.concatenate(rows, axis=0)


def verdicts(values: dict[str, float]) -> list[tuple[str, float, str, str]]:
    """What, value, unit and verdict of each measure."""
    return [(each.words, values[name], each.unit, each.verdict(values[name])) for name, each in MEASURES.items()]


def _cameras(field: framed_field.FramedField, up: str = "y") -> list[tuple[float, float, float]]:
    return [(*angles, framed_field.framing_radius(field, *angles, up)) for angles in VIEWS]


def _seen(
    field: framed_field.FramedField, truth: MeshField, camera: tuple[float, float, float], size: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Of one camera: errors of depth and angle where both see something, whether pixels that either sees agree, whether
    thin parts are seen.
    """
    starts, along = framed_field.camera_rays(field, camera, SIZE)
    back = field.field_from_mesh.inverse()
    asked = rays.OrientedPoints(back.apply(starts), back.apply_directions(along))
    got, true = (framed_field.query(each, asked, ("depth", "normals"))[0] for each in (field, truth))
    sees, there = np.isfinite(got["depth"]), np.isfinite(true["depth"])
    both = sees & there
    cosine = (got["normals"][both] * true["normals"][both]).sum(-1)
    off = np.abs(got["depth"][both] - true["depth"][both]) / size
    points = asked.positions[there] + true["depth"][there, None] * asked.directions[there]

    def depth(*placed: np.ndarray) -> np.ndarray:
        return framed_field.query(truth, rays.OrientedPoints(*placed), ("depth",))[0]["depth"]

    right = ~wrong(got["depth"], true["depth"], OFF * size)[there][thin(depth, points, true["normals"][there], size)]
    return 100 * off, np.degrees(np.arccos(np.clip(cosine, -1, 1))), both[sees | there], right


def thin(
    depth: Callable[..., Float[np.ndarray, "n"]],
    points: Float[np.ndarray, "n 3"],
    normals: Float[np.ndarray, "n 3"],
    size: float,
) -> Bool[np.ndarray, "n"]:
    """Which points of a surface have its other side nearer than `THIN` of the longest side, `size`; depth of it is
    from positions along directions, inf where nothing is met.
    """
    return depth(points - _LIFT * size * normals, -normals) <= THIN * size


def wrong_inside(field: framed_field.FramedField, truth: MeshField) -> float:
    """Per cent of rays from inside the box, anywhere and any way, that say other than the mesh whether, or where, they
    end.
    """
    random = np.random.default_rng(0)
    starts, along = random.uniform(field.lower, field.upper, (INSIDE, 3)), random.standard_normal((INSIDE, 3))
    back = field.field_from_mesh.inverse()
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    asked = rays.OrientedPoints(back.apply(starts), back.apply_directions(along))
    got, true = (framed_field.query(each, asked, ("depth",))[0]["depth"] for each in (field, truth))
    return _percent(wrong(got, true, OFF * _size(field)))


def wrong(depth: Float[np.ndarray, "n"], truth: Float[np.ndarray, "n"], bound: float) -> Bool[np.ndarray, "n"]:
    """Which rays say other than the truth whether they end, or are off by more than a bound; depths inf on a miss."""
    seen, there = np.isfinite(depth), np.isfinite(truth)
    off = np.abs(np.where(seen, depth, 0.0) - np.where(there, truth, 0.0)) > bound
    return (seen != there) | (seen & there & off)


def _size(field: framed_field.FramedField) -> float:
    """Longest side of the box, frame of the mesh."""
    return float((field.upper - field.lower).max()) / field.field_from_mesh.scale


def _median(values: Float[np.ndarray, "_"]) -> float:
    return float(np.median(values)) if len(values) else float("nan")


def _percent(which: Bool[np.ndarray, "_"]) -> float:
    return 100 * float(which.mean()) if len(which) else float("nan")
