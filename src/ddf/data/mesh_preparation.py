"""From any triangle soup to a small, normalised mesh, closed unless told otherwise, and what that lost.

clean -> close (alpha wrap) -> decimate -> field frame, each in float64 and in coordinates centred at 0, so that a mesh
far from its origin loses nothing. A wrap follows the outside only: sheets get a thickness of twice the offset, holes
narrower than alpha are closed, and everything hidden inside disappears. `measure` says how far that moved the surface.
Lengths in `MeshesConfig` and in the measures are relative to the diagonal of the raw mesh's box.
"""

import dataclasses
import time
from dataclasses import dataclass

import fast_simplification
import numpy as np
import pymeshlab
from jaxtyping import Bool, Float
from PIL import Image
from scipy import ndimage

from ddf.core import checks
from ddf.data import mesh_topology
from ddf.data.mesh_config import LOSSES, MeshesConfig
from ddf.data.samples.draws import Surface
from ddf.geometry import cameras, raycast, transforms
from ddf.geometry.mesh_io import Mesh, face_normals

LOSS_TO_TELL = 0.02  # of the diagonal: a larger Hausdorff distance is said in the verdict; alpha's default
THIN = 6  # offsets: the wrap of a sheet is two to four thick, on average
_SHARP = np.cos(np.radians(30.0))  # between the normals of two triangles: their edge is a feature
_MOST_PROBES = 200_000  # vertices and points on sharp edges each
# Good roots have 1.00; shapes that look alike from all sides may pass in a wrong one, a root of them not.
OVERLAP = 0.95
_OPAQUE = 128  # of 255


@dataclass(frozen=True)
class Prepared:
    """A mesh in the field frame, closed unless `wrap` is "never", the map that led there, what was lost, a verdict."""

    mesh: Mesh
    field_from_raw: transforms.Similarity
    watertight: bool
    wrapped: bool
    hausdorff: float
    mean_distance: float
    hausdorff_seen: float
    mean_distance_seen: float
    hausdorff_hidden: float
    lost: float
    seconds: float
    openings_filled: int
    verdict: str


def _to_meshlab(mesh: Mesh) -> pymeshlab.MeshSet:
    work = pymeshlab.MeshSet(verbose=False)
    work.add_mesh(pymeshlab.Mesh(mesh.vertices, mesh.faces))
    return work


def _from_meshlab(work: pymeshlab.MeshSet) -> Mesh:
    current = work.current_mesh()
    return Mesh(current.vertex_matrix(), current.face_matrix())


def close(mesh: Mesh, alpha: float, offset: float) -> Mesh:
    """The outside of a cleaned triangle soup as one closed manifold; lengths in diagonals of its box. InputError where
    the wrap leaves a part outside. Source: CGAL's alpha wrap (Portaneri et al. 2022).
    """
    soup = Mesh(mesh.triangles.reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))
    work = _to_meshlab(soup)  # MeshLab drops triangles that run along a shared edge the wrong way: so share none
    percent = pymeshlab.PercentageValue
    work.generate_alpha_wrap(alpha=percent(100 * alpha), offset=percent(100 * offset))
    wrap = _from_meshlab(work)
    if not mesh_topology.is_watertight(wrap):
        raise checks.InputError("the wrap is not closed; try another alpha")
    probes, scene = np.concatenate([mesh.vertices, mesh.triangles.mean(axis=1)]), raycast.Scene(wrap)
    left_out = probes[scene.outside(probes)]
    if len(left_out) and scene.distance(left_out).max() > 0.1 * offset * mesh.diagonal():
        raise checks.InputError("the wrap leaves a part of the mesh outside; try another alpha")
    return wrap


def decimate(mesh: Mesh, faces: int) -> Mesh:
    """Reduce a mesh to at most `faces` triangles by quadric edge collapse; a closed manifold stays one.

    fast-simplification where its result is still closed, otherwise MeshLab's collapse that preserves topology. A mesh
    that is open to begin with is left to fast-simplification. InputError where the topology needs more triangles.
    """
    if len(mesh.faces) <= faces:
        return mesh
    closed = mesh_topology.is_watertight(mesh)
    points, triangles = fast_simplification.simplify(
        np.ascontiguousarray(mesh.vertices), np.ascontiguousarray(mesh.faces, dtype=np.int32), target_count=faces
    )
    quick = mesh_topology.without_unused(Mesh(points, triangles))
    if len(quick.faces) <= faces and (
        not closed or (mesh_topology.is_watertight(quick) and mesh_topology.has_manifold_vertices(quick))
    ):
        return quick
    work = _to_meshlab(mesh)
    work.meshing_decimation_quadric_edge_collapse(
        targetfacenum=faces, preservetopology=True, preservenormal=True, planarquadric=True
    )
    slow = mesh_topology.without_unused(_from_meshlab(work))
    if len(slow.faces) > faces or mesh_topology.is_watertight(slow) < closed:
        raise checks.InputError(f"cannot reach {faces} triangles and stay closed; got {len(slow.faces)}: raise faces")
    return slow


def measure(raw: Mesh, result: Mesh, points: int, rng: np.random.Generator) -> dict[str, float]:
    """How far the surfaces of two meshes of one frame lie apart, in units of the raw box's diagonal.

    Both ways: from `points` points by area, all vertices and (of the raw mesh) points on sharp edges to the nearest
    point of the other surface; Open3D picks the nearest triangle in float32, which long slivers can mislead by 2e-4.

    Returns:
      `hausdorff`: largest distance of both ways. `mean_distance`: mean of the means of both ways, of points by area.
      `hausdorff_seen`, `mean_distance_seen`: the same of points by area, without raw points that cannot be seen from
      outside, because a wrap drops these on purpose.
      `hausdorff_hidden`: largest distance from a hidden raw point; 0 without any.
      `lost`: largest distance from a raw point that lies outside the result (a part cut off, not one smoothed over);
      an open result has no inside.
    """
    diagonal = raw.diagonal()
    raw_scene, result_scene = raycast.Scene(raw), raycast.Scene(result)
    raw_points, raw_faces = Surface.of(raw).draw(points, rng)
    result_points, _ = Surface.of(result).draw(points, rng)
    hidden = ~raycast.visible_from_outside(raw_scene, raw_points, raw_faces)
    probes = np.concatenate([raw_points, _features(raw)])
    there = result_scene.distance(probes) / diagonal
    closed = mesh_topology.is_watertight(result)
    outside = result_scene.outside(probes) if closed else np.ones(len(probes), dtype=bool)
    back = raw_scene.distance(np.concatenate([result_points, result.vertices])) / diagonal
    by_area, mean_back = there[:points], back[:points].mean()
    seen = by_area[~hidden] if (~hidden).any() else by_area
    return {
        "hausdorff": float(max(there.max(), back.max())),
        "mean_distance": float(0.5 * (by_area.mean() + mean_back)),
        "hausdorff_seen": float(max(seen.max(), back.max())),
        "mean_distance_seen": float(0.5 * (seen.mean() + mean_back)),
        "hausdorff_hidden": float(by_area[hidden].max(initial=0.0)),
        "lost": float(there[outside].max(initial=0.0)),
    }


def _features(mesh: Mesh) -> Float[np.ndarray, "k 3"]:
    """What points by area miss: the vertices of triangles with an area, and quarters of sharp and open edges."""
    normals, areas = face_normals(mesh)
    faces, normals = mesh.faces[areas > 0], normals[areas > 0]
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    pairs, edge = np.unique(edges, axis=0, return_inverse=True)
    order = np.argsort(edge.reshape(-1), kind="stable")
    label, normal = edge.reshape(-1)[order], normals[order // 3]
    turned = (label[1:] == label[:-1]) & (np.einsum("ij,ij->i", normal[1:], normal[:-1]) < _SHARP)
    feature = np.bincount(label, minlength=len(pairs)) == 1
    feature[label[1:][turned]] = True
    starts, stops = mesh.vertices[pairs[feature]].transpose(1, 0, 2)
    along = np.concatenate([starts + share * (stops - starts) for share in (0.25, 0.5, 0.75)])
    kept = [points[:: 1 + len(points) // _MOST_PROBES] for points in (mesh.vertices[np.unique(faces)], along)]
    return np.concatenate(kept)


def thickness(mesh: Mesh) -> float:
    """How thick a closed mesh is on average, as a share of its diagonal: 2 V / A, which is right for a sheet."""
    _, areas = face_normals(mesh)
    return float(2 * np.abs(mesh_topology.volumes(mesh)).sum() / areas.sum() / mesh.diagonal())


def prepare(raw: Mesh, config: MeshesConfig, rng: np.random.Generator) -> Prepared:
    """Clean, close (unless `wrap` is "never"), decimate and normalise one mesh, and measure the loss.

    A mesh that was neither closed nor decimated has lost nothing: no point of it is asked for. InputError where there
    is nothing to close, or the result cannot be both closed and small enough.
    """
    begin = time.perf_counter()
    unit_from_raw = transforms.field_from_mesh(raw.surface_vertices())
    unit = mesh_topology.clean(Mesh(unit_from_raw.apply(raw.vertices), raw.faces))
    whole, openings = mesh_topology.fill_openings(unit) if config.holes else (unit, 0)
    wrapped = config.wrap == "always" or (config.wrap == "auto" and not mesh_topology.is_sound(whole))
    solid = close(whole, config.alpha, config.offset) if wrapped else whole
    small = decimate(mesh_topology.outward(solid) if config.wrap != "never" else solid, config.faces)
    as_it_was = not wrapped and len(small.faces) == len(unit.faces)  # at most turned inside out
    losses = dict.fromkeys(LOSSES, 0.0) if as_it_was else measure(unit, small, config.measure_points, rng)
    field_from_unit = transforms.field_from_mesh(small.vertices)
    mesh = Mesh(field_from_unit.apply(small.vertices), small.faces)
    prepared = Prepared(
        mesh=mesh,
        field_from_raw=field_from_unit.compose(unit_from_raw),
        watertight=mesh_topology.is_watertight(mesh),
        wrapped=wrapped,
        openings_filled=openings,
        seconds=time.perf_counter() - begin,
        verdict="",
        **losses,
    )
    widths = mesh_topology.entered_openings(unit, solid) if wrapped and prepared.watertight else []
    return dataclasses.replace(prepared, verdict=_verdict(prepared, raw, unit, widths, config))


def _verdict(prepared: Prepared, raw: Mesh, unit: Mesh, widths: list[float], config: MeshesConfig) -> str:
    """What was done, and what a user should know before trusting it, in one line."""
    said = ["wrapped" if prepared.wrapped else "kept as it is"]
    if prepared.openings_filled:
        said.insert(0, f"{prepared.openings_filled} openings filled")
    if len(prepared.mesh.faces) < len(unit.faces) and not prepared.wrapped:
        said.append(f"reduced to {len(prepared.mesh.faces)} triangles")
    if prepared.watertight and not prepared.wrapped:
        inside = mesh_topology.nesting(unit)
        held = 0 if inside is None else int(inside.any(axis=1).sum())
        said += [f"{held} of its parts lie inside others: walls of cavities, or bodies in them"] if held else []
    if widths:
        thin = thickness(prepared.mesh)
        share = f", {100 * thin:.2g} % of the diagonal thick" if thin < THIN * config.offset else " in part"
        more = f"{len(widths)} openings, the widest {max(widths):.2g} of the diagonal; try --close holes"
        said.append(f"a thin shell{share}: {more}")
    if prepared.hausdorff > LOSS_TO_TELL:
        hidden = " (hidden parts)" if prepared.hausdorff_seen < prepared.hausdorff_hidden else ""
        said.append(f"up to {100 * prepared.hausdorff:.2g} % of the diagonal away from the raw mesh{hidden}")
    if len(unit.faces) < 4 or (prepared.wrapped and 2 * len(unit.faces) < len(raw.faces)):
        said.append(f"made from {len(unit.faces)} of {len(raw.faces)} triangles")
    return "; ".join(said)


def require_silhouette(mesh: Mesh, image: str, *camera: float) -> float:
    """The overlap of the silhouette of a mesh, as of ShapeNet v1, with the image's alpha, cast in some 10 ms;
    InputError with likely causes where it is less than `OVERLAP`.

    Roots of another kind would train without a word: meshes turned (ShapeNetCore.v2), scaled, or of other ids; angles
    in radians.

    Args:
      image: RGBA, a path. camera: as the metadata have it: azimuth and elevation in degrees, benchmark units.
    """
    with Image.open(image) as opened:
        seen = np.asarray(opened.getchannel("A")) >= _OPAQUE
    found = overlap(_silhouette(mesh, np.array(camera)), seen)
    if found >= OVERLAP:
        return found
    raise checks.InputError(
        f"its silhouette overlaps that of {image} by {found:.2f}, not {OVERLAP}: both must be of one shape, the "
        "mesh as in ShapeNetCore.v1 (v2's are turned), centred with a diagonal of 1, the camera's angles in degrees"
    )


def overlap(cast: Bool[np.ndarray, "h w"], seen: Bool[np.ndarray, "h w"]) -> float:
    """Intersection over union, up to one pixel: edges are drawn softly, and thin parts are little else."""
    near_cast, near_seen = (ndimage.binary_dilation(mask, np.ones((3, 3))) for mask in (cast, seen))
    union = int((cast | seen).sum())
    return 1.0 - int((cast & ~near_seen | seen & ~near_cast).sum()) / union if union else 0.0


def _silhouette(mesh: Mesh, camera_deg: Float[np.ndarray, "3"]) -> Bool[np.ndarray, "h w"]:
    """Where a camera sees a mesh of the frame v1."""
    camera = cameras.degrees_to_radians(camera_deg)
    pixels = cameras.pixel_directions(cameras.IMAGE_SIZE, camera).reshape(-1, 3)
    centre, along = cameras.pixel_rays(camera[0], camera[1], camera[2], pixels)
    start = np.broadcast_to(centre / transforms.BENCHMARK_FROM_V1, along.shape)
    _, face = raycast.Scene(mesh).first_hits(start, along)
    return (face >= 0).reshape(cameras.IMAGE_SIZE, cameras.IMAGE_SIZE)
