"""Commands about meshes and clouds."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from ddf.cli import arguments, results
from ddf.cli.arguments import MeshPath, Natural, Rays, Seed
from ddf.cli.declare import Arg, command

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float


FAR = 1e-3  # of the diagonal: what float32 rays may be off by before the user is told
_OTHER_UNITS = 5.0  # times as large as the truth: no error of a prediction
_BENCHMARK = (0.25, 1.25)  # diagonals of boxes for which the default threshold is meant: benchmark units to v1


@command("mesh")
def mesh(
    source: Annotated[Path, Arg("IN")],
    out: Annotated[Path, Arg("OUT", writes="file")],
    *,
    faces: Annotated[int, Arg("N")] = 10_000,
    alpha: Annotated[float, Arg("A")] = 0.02,
    close: Literal["wrap", "holes"] = "wrap",
) -> dict[str, Any]:
    """Validate, close, decimate and normalise a mesh; say what was lost.

    Distances are shares of the diagonal of the raw mesh's box.

    Args:
      source: mesh to read (.obj, .ply, .stl, .off, .glb, .gltf, .dae, .3mf, .ac, .acc).
      out: mesh to write, in the field frame (.obj, .ply, .stl, .off, .glb).
      faces: at most this many triangles.
      alpha: openings narrower than this share of the diagonal are closed.
      close: holes: fill openings first, and wrap only what is still not closed.

    Examples:
      ddf mesh shape.obj closed.ply
      ddf mesh shape.obj closed.obj --faces 500 --alpha 0.02
    """
    from ddf.data import mesh_config
    from ddf.geometry import mesh_io

    config = mesh_config.MeshesConfig(faces=faces, alpha=alpha, holes=close == "holes")
    mesh_io.require_suffix(out.suffix)
    raw = mesh_io.load_surface(source)
    from ddf.core import seeding, storage  # a bad file is refused before these load 0.9 GiB of packages
    from ddf.data import mesh_preparation

    prepared = mesh_preparation.prepare(raw, config, seeding.generator(config.seed, "measure"))
    storage.write_bytes(out, mesh_io.export_bytes(prepared.mesh, out.suffix))

    def share(value: float) -> str:
        return f"{100 * value:.2g} % of the diagonal"

    return {
        "watertight": prepared.watertight,
        "faces": len(prepared.mesh.faces),
        "hausdorff": prepared.hausdorff,
        "mean_distance": prepared.mean_distance,
        **{name: getattr(prepared, name) for name in mesh_config.LOSSES[2:]},
        "wrapped": prepared.wrapped,
        "openings_filled": prepared.openings_filled,
        "faces_raw": len(raw.faces),
        "seconds": round(prepared.seconds, 3),
        "transform": prepared.field_from_raw.to_dict(),
        "left_out": list(raw.remarks),
        "outcome": prepared.verdict,
        "table": {
            "faces": f"{len(prepared.mesh.faces):,}, from {len(raw.faces):,}",
            "way": "closed by a wrap"
            if prepared.wrapped
            else f"{prepared.openings_filled:,} openings filled"
            if prepared.openings_filled
            else "closed already, kept as it is",
            "largest distance": share(prepared.hausdorff),
            "of what is seen": share(prepared.hausdorff_seen),
            "mean distance": share(prepared.mean_distance),
            "mean of what is seen": share(prepared.mean_distance_seen),
            "of hidden parts, largest": share(prepared.hausdorff_hidden),
            "of parts cut off, largest": share(prepared.lost),
            "left out": "; ".join(raw.remarks) or "nothing",
            "seconds": prepared.seconds,
        },
        "verdict": f"watertight: {'yes' if prepared.watertight else 'NO'}, {len(prepared.mesh.faces):,} faces; "
        f"{prepared.verdict}",
    }


@command("mesh")
def cast(mesh: MeshPath, *, rays: Rays, out: Annotated[Path, Arg("HITS.npz", writes="file")]) -> dict[str, Any]:
    """Exact depth, visibility and normals of a mesh along given rays.

    Everything is in the frame and the unit of the file; depth is `inf` on a miss.

    Args:
      mesh: mesh file; cast as it is, without closing it.
      out: gets depth, visible, normals.

    Examples:
      ddf cast shape.obj --rays rays.npz --out hits.npz
    """
    from ddf.api import queries
    from ddf.core import storage
    from ddf.geometry import mesh_io, raycast
    from ddf.geometry import rays as ray_files

    points = ray_files.read_npz(rays)
    queries.require_near(points.positions)
    loaded = mesh_io.load(mesh)
    hits = raycast.cast(loaded, points)
    arrays = {"depth": hits.depth, "visible": hits.visible, "normals": hits.normals}
    storage.write_bytes(out, results.npz(arrays))
    count, seen = len(hits.depth), int(hits.visible.sum())
    verdict = f"{seen:,} of {count:,} rays hit; depth is in units of {mesh}, inf on a miss"
    verdict += results.left_out(loaded.remarks)
    bound = raycast.float32_bound(loaded, points)
    if bound > FAR * loaded.diagonal():
        verdict += f"; starts lie so far away that float32 positions or directions are off by up to {bound:.2g}"
    if not seen:
        verdict += results.other_units("rays'", points.positions, "mesh's", loaded.vertices)
    found = {"rays": count, "hits": seen, "float32_bound": bound, "left_out": list(loaded.remarks)}
    return {**found, "verdict": verdict}


@command("mesh")
def samples(
    mesh: MeshPath,
    out: Annotated[Path, Arg("OUT.safetensors", writes="file")],
    *,
    seed: Seed = 0,
    count: Annotated[int, Arg("N", parse=arguments.whole_number(2))] = 250_000,
) -> dict[str, Any]:
    """The six types of oriented-point samples of a mesh.

    The file is described among the [formats](formats.md).

    Args:
      mesh: mesh file; sampled as it is, in the field frame.
      out: gets <type>.positions, ... (docs/formats.md).
      seed: equal seeds, equal bytes.
      count: of types U and A; the others N/2.

    Examples:
      ddf samples shape.obj samples.safetensors --count 2000
    """
    import numpy as np

    from ddf.core import storage
    from ddf.data.samples import extraction, sample_types
    from ddf.geometry import mesh_io, transforms

    counts = {kind: count if kind in "UA" else count // 2 for kind in sample_types.KINDS}
    config = extraction.SamplesConfig(counts=counts, epsilon_o=0.05, offsets="fixed", box="tight", seed=seed)
    raw = mesh_io.load_surface(mesh)
    field_from_raw, solid = transforms.field_from_mesh(raw.surface_vertices()), mesh_io.without_flat(raw)
    arrays = extraction.extract(mesh_io.Mesh(field_from_raw.apply(solid.vertices), solid.faces), config)
    metadata = {
        "seed": seed,
        "sources": {mesh.name: storage.checksum(mesh)},
        "field_from_raw": field_from_raw.to_dict(),
    }
    storage.save_tensors(out, arrays, metadata)
    shares = {kind: float(np.mean(arrays[f"{kind}.depth"] != np.iinfo(np.uint16).max)) for kind in counts}
    return {
        "counts": counts,
        "hit_share": shares,
        **metadata,
        "left_out": list(raw.remarks),
        "table": results.grid(
            ("type", "samples", "hit"), [(kind, number, f"{shares[kind]:.1%}") for kind, number in counts.items()]
        ),
        "verdict": f"{sum(counts.values()):,} samples in {out}{results.left_out(raw.remarks)}",
    }


@command("mesh", api="meshes:compare")
def compare(
    pred: Annotated[Path, Arg("PRED")],
    truth: Annotated[Path, Arg("TRUTH")],
    *,
    tau_sq: Annotated[float, Arg("T")] = 1e-4,
    points: Natural = 10_000,
    seed: Seed = 0,
    relative: bool = False,
) -> dict[str, Any]:
    """Chamfer distance and F-scores of two clouds or meshes, nothing scaled.

    Args:
      pred: prediction: a PLY cloud, or a mesh, on which points are drawn by area.
      truth: truth, likewise, in the same frame and units.
      points: drawn on each mesh.
      seed: of these points.

    Examples:
      ddf compare cloud.ply truth.ply
      ddf compare cloud.ply shape.obj --points 30000 --seed 1
      ddf compare cloud.ply scan_in_millimetres.stl --relative
    """
    import numpy as np

    from ddf.api import meshes
    from ddf.core import seeding
    from ddf.geometry import mesh_io
    from ddf.metrics import cloud_scores

    def read(path: Path, stream: str) -> "tuple[Float[np.ndarray, 'n 3'], str]":
        """Points of a file, and in words which; each of the two meshes has a random stream of its own."""
        may_be_points = path.suffix.lower() == ".ply" or path.suffix.lower() not in mesh_io.READ
        if may_be_points and not mesh_io.has_faces(path):
            found = mesh_io.read_points(path)
            return found, f"{len(found):,} points"
        loaded = mesh_io.load(path)
        from ddf.data.samples import draws

        drawn, _ = draws.Surface.of(loaded).draw(points, seeding.generator(seed, "compare", stream))
        return drawn, f"{len(drawn):,} points drawn by area (seed {seed})"

    (pred_points, pred_is), (true_points, truth_is) = read(pred, "pred"), read(truth, "truth")
    diagonal = float(np.linalg.norm(np.ptp(true_points, axis=0)))
    compared = meshes.compare(pred_points, true_points, tau_sq, relative).to_dict()
    units = {metric.score: metric.unit for metric in cloud_scores.METRICS.values()}
    units |= {"chamfer_l2_sq": "share of the truth's squared diagonal"} if relative else {}
    length = "of the box's diagonal" if relative else "units"
    verdict = f"F-score {compared['f_score_tau']:.1%} within {tau_sq**0.5:.4g} {length}: "
    verdict += f"{pred_is} of {pred.name} against {truth_is} of {truth.name}"
    if not (relative or _BENCHMARK[0] < diagonal < _BENCHMARK[1]):
        verdict += f"; the truth's box measures {diagonal:.4g} units: --relative takes shares of that"
    verdict += results.other_units("prediction's", pred_points, "truth's", true_points, _OTHER_UNITS)
    found = {**compared, "tau_sq": tau_sq, "box_diagonal": diagonal, "relative": relative}
    table = results.grid(
        ("score", "value", "unit"), [(name, value, units.get(name, "")) for name, value in found.items()]
    )
    return {**found, "pred": pred_is, "truth": truth_is, "table": table, "verdict": verdict}
