"""`ddf compare`: Chamfer distance and F-scores of two point clouds; of a mesh, points drawn on it count."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddf.cli import arguments

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float

_USUAL = (0.25, 1.25)  # diagonals of boxes for which the default threshold is meant: benchmark units to v1
POINTS = 10_000  # drawn on each mesh, as benchmarks of meshes do
EXAMPLES = (
    "ddf compare cloud.ply truth.ply",
    "ddf compare cloud.ply shape.obj --points 30000 --seed 1",
    "ddf compare cloud.ply scan_in_millimetres.stl --relative",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare PRED, TRUTH, the threshold and how points are drawn on meshes."""
    parser.add_argument(
        "pred", metavar="PRED", type=Path, help="prediction: a PLY cloud, or a mesh, on which points are drawn by area"
    )
    parser.add_argument("truth", metavar="TRUTH", type=Path, help="truth, likewise, in the same frame and units")
    parser.add_argument(
        "--tau-sq",
        type=float,
        default=1e-4,
        metavar="T",
        help="threshold on squared distance (hit when <=); default %(default)g, meant for benchmark units",
    )
    parser.add_argument(
        "--points",
        metavar="N",
        type=arguments.whole_number(1),
        default=POINTS,
        help="drawn on each mesh (default %(default)s)",
    )
    parser.add_argument(
        "--seed", metavar="S", type=arguments.whole_number(0), default=0, help="of these points (default %(default)s)"
    )
    parser.add_argument(
        "--relative", action="store_true", help="lengths are shares of the diagonal of the truth's box, T too"
    )
    parser.add_argument("--vertices", action="store_true", help="of a mesh, take the vertices instead")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Scores as they are (nothing times 100 or 1000): chamfer_l2_sq is the sum of both means of squared distances."""
    import numpy as np

    from ddf.api import scores
    from ddf.cli import results
    from ddf.core import checks
    from ddf.metrics import cloud_scores

    read = []
    for name in ("pred", "truth"):
        try:
            read.append(_read(getattr(args, name), args, name))
        except MemoryError as fault:
            raise checks.InputError(f"{getattr(args, name)}: does not fit into memory") from fault
    (pred, pred_is), (truth, truth_is) = read
    diagonal = float(np.linalg.norm(np.ptp(truth, axis=0)))
    compared = scores.compare(pred, truth, args.tau_sq, args.relative).to_dict()
    units = {metric.score: metric.unit for metric in cloud_scores.METRICS.values()}
    length = "of the box's diagonal" if args.relative else "units"
    verdict = (
        f"F-score {compared['f_score_tau']:.1%} within {args.tau_sq**0.5:.4g} {length}: {pred_is} of {args.pred.name} "
        f"against {truth_is} of {args.truth.name}"
    )
    if not (args.relative or _USUAL[0] < diagonal < _USUAL[1]):
        verdict += f"; the truth's box measures {diagonal:.4g} units: --relative takes shares of that"
    found = {**compared, "tau_sq": args.tau_sq, "box_diagonal": diagonal, "relative": args.relative}
    rows = [(name, value, units.get(name, "")) for name, value in found.items()]
    table = results.grid(("score", "value", "unit"), rows)
    return {**found, "pred": pred_is, "truth": truth_is, "table": table, "verdict": verdict}


def _read(path: Path, args: argparse.Namespace, stream: str) -> "tuple[Float[np.ndarray, 'n 3'], str]":
    """Points of a file, and in words which; each of the two meshes has a random stream of its own."""
    from ddf.core import seeding
    from ddf.geometry import mesh_io

    if path.suffix.lower() == ".ply" or path.suffix.lower() not in mesh_io.READ:
        is_mesh = mesh_io.has_faces(path)
        if args.vertices or not is_mesh:
            points = mesh_io.read_points(path)
            return points, f"{len(points):,} {'vertices' if is_mesh else 'points'}"
    mesh = mesh_io.load(path)
    if args.vertices:
        return mesh.vertices, f"{len(mesh.vertices):,} vertices"
    from ddf.data.samples import draws

    points, _ = draws.Surface.of(mesh).draw(args.points, seeding.generator(args.seed, "compare", stream))
    return points, f"{len(points):,} points drawn by area (seed {args.seed})"
