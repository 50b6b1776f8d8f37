"""A field fitted to one shape: its file, and what can be asked of it, in the frame of the mesh that was fitted.

Rays come in the mesh's own frame and unit. They are moved to the field frame in float64, enter the field's box by the
slab test, and are narrowed to float32 only there, so that a camera 1e3 box lengths away costs no precision. Rays that
miss the box are never evaluated. Where the box is missed, or visibility is below 1/2, nothing is seen: depth is `inf`,
every other output is 0.
"""

from collections.abc import Collection
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from ddf.core import checks, storage
from ddf.fields import cloud_projection, curvature, derivatives, rendering, sparse_depth
from ddf.fields.pddf import NUM_COMPONENTS, PDDF, WEIGHT_ROW, PDDFConfig, visibility
from ddf.geometry import cameras, rays, transforms
from ddf.training import training_loop

KIND = "single_shape"  # of the file's record
COMPONENT_OUTPUTS = ("weight_1", "normals_1", "normals_2")  # w_1, n_1, n_2 of the mixture's two components
OUTPUTS = (*rendering.OUTPUTS, *curvature.OUTPUTS, *COMPONENT_OUTPUTS)
SEEN = 0.5  # visibility from which on a surface counts as seen
CHUNK_RAYS = 16384  # speed and memory only
_UP_FROM_Y = {"y": np.eye(3), "z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])}
UP_AXES = tuple(_UP_FROM_Y)


@dataclass(frozen=True)
class ShapeField:
    """A trained field, its box (field frame), the map to its frame, and the record of its file."""

    field: PDDF
    lower: Float[np.ndarray, "3"]
    upper: Float[np.ndarray, "3"]
    field_from_mesh: transforms.Similarity
    record: dict[str, Any]


def description(
    config: PDDFConfig,
    lower: Float[np.ndarray, "3"],
    upper: Float[np.ndarray, "3"],
    field_from_mesh: transforms.Similarity,
) -> dict[str, Any]:
    """What the record of a field file must hold for `load`, besides what every artefact carries."""
    return {
        "kind": KIND,
        "field": asdict(config),
        "box": {"lower": lower.tolist(), "upper": upper.tolist()},
        "field_from_mesh": field_from_mesh.to_dict(),
    }


def load(path: Path) -> ShapeField:
    """A field from its file, or from the folder that `ddf fit` wrote, in evaluation mode.

    Raises:
      FileNotFoundError: there is no such file. InputError: it is damaged, or holds something else; it is named.
    """
    folder = path.parent if path.name == training_loop.MODEL else path
    file = folder / training_loop.MODEL
    if not file.exists():
        raise FileNotFoundError(f"{file}: no such field; give a folder that `ddf fit` wrote")
    record = storage.load_metadata(file)
    if record.get("kind") != KIND:
        raise checks.InputError(f"{file}: holds no field of a single shape; give a folder that `ddf fit` wrote")
    try:
        config = PDDFConfig(**{**record["field"], "hidden": tuple(record["field"]["hidden"])})
        lower, upper = (np.array(record["box"][side], dtype=np.float64) for side in ("lower", "upper"))
        field_from_mesh = transforms.Similarity.from_dict(record["field_from_mesh"])
    except (KeyError, TypeError) as error:
        raise checks.InputError(f"{file}: its record lacks what a field needs ({error})") from error
    field = PDDF(config)
    training_loop.load_model(field, folder)
    return ShapeField(field, lower, upper, field_from_mesh, record)


def evaluate(
    field: PDDF, positions: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"], outputs: Collection[str]
) -> dict[str, Tensor]:
    """Named outputs in the field frame: those of `rendering.query`, the curvatures and those of `components`.

    No pass that nothing asks for.

    Raises:
      InputError: an output that does not exist.
    """
    unknown = sorted(set(outputs) - set(OUTPUTS))
    if unknown:
        raise checks.InputError(f"outputs must be among {', '.join(OUTPUTS)}; got {', '.join(unknown)}")
    parts = components(field, positions, directions, outputs)
    others = [name for name in outputs if name not in COMPONENT_OUTPUTS]
    curvatures = [name for name in curvature.OUTPUTS if name in outputs]
    if others and not curvatures:
        return parts | rendering.query(field, positions, directions, None, others)
    if not others:
        return parts
    surface = curvature.surface(field, positions, directions, None, curvatures)
    found = {
        "visibility": visibility(surface.raw),
        "depth": field.depth(surface.raw),
        "normals": surface.normals,
        "mean_curvature": surface.mean,
        "gaussian_curvature": surface.gaussian,
    }
    return parts | {name: values for name, values in found.items() if name in outputs and values is not None}


def components(
    field: PDDF, positions: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"], outputs: Collection[str]
) -> dict[str, Tensor]:
    """What the components of the mixture say by themselves, field frame; only what is asked for.

    weight_1 (n) is w_1 in [0, 1]; where it is at least 1/2 component 1 gives the output. normals_1, normals_2 (n, 3)
    are n_i = ±∇_p d_i/‖∇_p d_i‖, facing back, of both components, whichever is heavier: the lighter one may show the
    surface behind the visible one. Source: [DDF22] §3.3, fig. `seethrough`.
    """
    if not set(outputs) & set(COMPONENT_OUTPUTS):
        return {}
    trace = derivatives.trace(field.network, field.inputs(positions, directions))
    found = {}
    if "weight_1" in outputs:
        found["weight_1"] = torch.sigmoid(trace.outputs[..., WEIGHT_ROW])
    for row, name in zip(torch.eye(NUM_COMPONENTS).to(trace.outputs), ("normals_1", "normals_2"), strict=True):
        if name in outputs:
            gradient = derivatives.adjoint(field.network, trace.slopes, row.expand(len(positions), -1))
            found[name] = derivatives.normals(field.turned(gradient, directions), directions)
    return found


@torch.no_grad()
def query(
    shape: ShapeField, points: rays.OrientedPoints, outputs: Collection[str] = rendering.OUTPUTS
) -> tuple[dict[str, Float[np.ndarray, "n ..."]], int]:
    """Named outputs at oriented points of the mesh's frame, and the number of rays that the field was evaluated for.

    Args:
      points: (n, 3), float64 for far cameras; anywhere, the start need not lie in the box.
      outputs: some of `OUTPUTS`.
    Returns:
      visibility (n) in [0, 1], 0 where the box is missed; depth (n) in mesh units; normals (n, 3), unit, facing back;
      mean_curvature (n) in 1/mesh unit and gaussian_curvature (n) in 1/mesh unit², signs as in `curvature.surface`;
      weight_1 (n), normals_1 and normals_2 (n, 3) as in `components`.
    Raises:
      InputError: an output that does not exist.
    """
    positions = shape.field_from_mesh.apply(points.positions.double().cpu().numpy())
    directions = shape.field_from_mesh.apply_directions(points.directions.double().cpu().numpy())
    found, evaluated = _query_field_frame(shape, positions, directions, outputs)
    scale = shape.field_from_mesh.scale
    if "depth" in found:
        found["depth"] = found["depth"] / scale
    for name in ("normals", "normals_1", "normals_2"):
        if name in found:
            found[name] = shape.field_from_mesh.inverse().apply_directions(found[name])
    if "mean_curvature" in found:
        found["mean_curvature"] = found["mean_curvature"] * scale
    if "gaussian_curvature" in found:
        found["gaussian_curvature"] = found["gaussian_curvature"] * scale**2
    return found, evaluated


def _query_field_frame(
    shape: ShapeField, positions: np.ndarray, directions: np.ndarray, outputs: Collection[str]
) -> tuple[dict[str, np.ndarray], int]:
    """As `query`, everything in the field frame and float64."""
    starts, along = torch.from_numpy(positions), torch.from_numpy(directions)
    entry, distance, meets = rays.enter_box(starts, along, torch.from_numpy(shape.lower), torch.from_numpy(shape.upper))
    weight = shape.field.network.head.weight
    inside, looking = entry[meets].to(weight), along[meets].to(weight)
    parts = [
        evaluate(shape.field, p, v, {*outputs, "visibility"})
        for p, v in zip(inside.split(CHUNK_RAYS), looking.split(CHUNK_RAYS), strict=True)
    ]
    seen = torch.zeros_like(meets)
    seen[meets] = torch.cat([part["visibility"] for part in parts]).cpu() >= SEEN
    found = {}
    for name in OUTPUTS:
        if name in outputs:
            values = torch.cat([part[name] for part in parts]).double().cpu()
            found[name] = _scattered(name, values, meets, seen, distance).numpy()
    return found, int(meets.sum())


def _scattered(
    name: str, values: Tensor, meets: Bool[Tensor, "n"], seen: Bool[Tensor, "n"], distance: Float[Tensor, "n"]
) -> Tensor:
    """Values of the rays that meet the box among all rays, with the background where nothing is seen."""
    whole = values.new_full((len(meets), *values.shape[1:]), torch.inf if name == "depth" else 0.0)
    whole[meets] = values
    if name == "visibility":
        return whole
    if name == "depth":
        return torch.where(seen, whole + distance, torch.inf)
    return torch.where(seen.reshape(-1, *[1] * (whole.ndim - 1)), whole, 0.0)


def camera_rays(
    shape: ShapeField, camera: tuple[float, float, float], size: int, up: str = "y"
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
    """Starts and unit directions, field frame, of a camera that looks at the box's centre; rows from the top.

    Args:
      camera: azimuth and elevation in degrees, radius in benchmark units: 0.57 is one diagonal of the box
        (`cameras`, whose lens it has).
      up: the axis of the mesh's frame that points up.
    """
    azimuth, elevation, radius = torch.tensor(camera, dtype=torch.float64)
    pixels = cameras.pixel_directions(size, torch.float64).reshape(-1, 3)
    centre, world = cameras.pixel_rays(torch.deg2rad(azimuth), torch.deg2rad(elevation), radius, pixels)
    box_centre, unit, turn = _camera_frame(shape, up)
    start = unit * (turn @ centre.numpy()) + box_centre
    return np.broadcast_to(start, world.shape).copy(), world.numpy() @ turn.T


def camera_at(shape: ShapeField, position: Float[np.ndarray, "3"], up: str = "y") -> tuple[float, float, float]:
    """Azimuth and elevation (degrees) and radius of the camera of `camera_rays` that stands at a point, field frame."""
    box_centre, unit, turn = _camera_frame(shape, up)
    x, y, z = turn.T @ (position - box_centre) / unit
    level = np.hypot(x, z)
    return float(np.degrees(np.arctan2(z, x))), float(np.degrees(np.arctan2(y, level))), float(np.hypot(level, y))


def _camera_frame(shape: ShapeField, up: str) -> tuple[Float[np.ndarray, "3"], float, Float[np.ndarray, "3 3"]]:
    """The box's centre, field units per benchmark unit, and the rotation from benchmark to field axes."""
    unit = float(np.linalg.norm(shape.upper - shape.lower)) / transforms.BENCHMARK_FROM_V1
    return (shape.lower + shape.upper) / 2, unit, shape.field_from_mesh.rotation @ _UP_FROM_Y[up]


def render(
    shape: ShapeField,
    camera: tuple[float, float, float],
    size: int,
    outputs: Collection[str] = rendering.OUTPUTS,
    up: str = "y",
) -> tuple[dict[str, Float[np.ndarray, "size size ..."]], int]:
    """Images from one camera (`camera_rays`), as `query` gives them, and the number of rays evaluated.

    Raises:
      InputError: a size below 1, a radius below 0, an unknown axis or output, or a camera that is not finite.
    """
    starts, directions = _checked_rays(shape, camera, size, up)
    mesh_from_field = shape.field_from_mesh.inverse()
    points = rays.OrientedPoints(
        torch.from_numpy(mesh_from_field.apply(starts)), torch.from_numpy(mesh_from_field.apply_directions(directions))
    )
    found, evaluated = query(shape, points, outputs)
    return {name: values.reshape(size, size, *values.shape[1:]) for name, values in found.items()}, evaluated


def _checked_rays(
    shape: ShapeField, camera: tuple[float, float, float], size: int, up: str
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
    """As `camera_rays`.

    Raises:
      InputError: a size below 1, a radius below 0, an unknown axis, or a camera that is not finite.
    """
    checks.require_finite("camera", np.array(camera))
    if size < 1 or camera[2] < 0 or up not in UP_AXES:
        raise checks.InputError(
            f"size must be >= 1, camera radius >= 0, up among {', '.join(UP_AXES)}; got {size}, {camera[2]}, {up}"
        )
    return camera_rays(shape, camera, size, up)


@torch.no_grad()
def render_depth(
    shape: ShapeField, camera: tuple[float, float, float], size: int, how: sparse_depth.Refinement, up: str = "y"
) -> tuple[Float[np.ndarray, "size size"], int]:
    """The depth of `render` from fewer rays, interpolated where that is close enough, and how many were evaluated.

    Args:
      how: its tolerance is in mesh units.
    Raises:
      InputError: as `render`.
    """
    starts, directions = _checked_rays(shape, camera, size, up)
    total = 0

    def ask(pixels: Int[np.ndarray, "k"]) -> Float[np.ndarray, "k"]:
        nonlocal total
        found, evaluated = _query_field_frame(shape, starts[pixels], directions[pixels], ("depth",))
        total += evaluated
        return found["depth"] / shape.field_from_mesh.scale

    image, _ = sparse_depth.depth_image(ask, size, how)
    return image, total


@torch.no_grad()
def cloud(
    shape: ShapeField, count: int, config: cloud_projection.CloudConfig, seed: int = 0
) -> Float[np.ndarray, "count 3"]:
    """Points on the surface, mesh frame: points of the box projected N_H times.

    As `cloud_projection.sample`, with B the field's own box.
    """
    if count < 1:
        raise checks.InputError(f"the number of points must be >= 1; got {count}")
    generator = torch.Generator(shape.field.network.head.weight.device).manual_seed(seed)
    box = (shape.lower.tolist(), shape.upper.tolist())
    cycles = cloud_projection.sample(shape.field, None, count, config, generator, box)
    (kept,) = cloud_projection.select(cycles, [count], config)
    return shape.field_from_mesh.inverse().apply(kept.double().cpu().numpy())
