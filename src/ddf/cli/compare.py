"""`ddf compare`: Chamfer distance and F-scores of two point clouds."""

import argparse
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.evaluation import metrics
from ddf.geometry import point_io


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare PRED, TRUTH and the threshold."""
    parser.add_argument("pred", metavar="PRED.ply", type=Path, help="predicted cloud; a mesh counts with its vertices")
    parser.add_argument("truth", metavar="TRUTH.ply", type=Path, help="true cloud, in the same frame and units")
    parser.add_argument(
        "--tau-sq",
        type=float,
        default=metrics.TAU_SQ,
        metavar="T",
        help="threshold on squared distance (hit when <=); default %(default)g, meant for benchmark units",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Scores as they are (nothing times 100 or 1000): chamfer_l2_sq is the sum of both means of squared distances."""
    pred, truth = (_read(path) for path in (args.pred, args.truth))
    return {**dataclasses.asdict(metrics.compare_clouds(pred, truth, args.tau_sq)), "tau_sq": args.tau_sq}


def _read(path: Path) -> Float[np.ndarray, "n 3"]:
    try:
        return point_io.read_points(path)
    except MemoryError as fault:
        raise checks.InputError(f"{path}: does not fit into memory") from fault
