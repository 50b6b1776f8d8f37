"""`ddf complete`: the whole object of a depth image or a lidar scan, with a trained model."""

import argparse
from pathlib import Path
from typing import Any

from ddf.cli import arguments
from ddf.core import shipped_models

EXAMPLES = (
    "ddf complete scan.npz chair whole_chair",
    "ddf complete scan.npz chair whole_chair --pose pose.json --fixed --noise 0.005",
)
LIKELY = 0.5  # share of explained hits under which the scan is called unlike the category
UPS = ("y", "z", "-y")  # as `api.completion`


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare scan, model, output folder and pose."""
    parser.add_argument(
        "scan",
        metavar="SCAN",
        type=Path,
        help="NPZ of rays with ranges, of a depth image or of points with sensors; or a depth PNG: docs/complete.md",
    )
    arguments.mark_known(parser, "model", "reconstruction")
    parser.add_argument(
        "model", metavar="MODEL", type=shipped_models.place, help="as of `ddf reconstruct`: the category of the object"
    )
    arguments.add_folder(
        parser, "gets the field as model.safetensors, seen.ply, inferred.ply, cloud.npz, completion.json"
    )
    parser.add_argument(
        "--pose", metavar="POSE.json", type=Path, help="4x4, where the object's box lies (default: found by itself)"
    )
    parser.add_argument("--fixed", action="store_true", help="the pose is known, and does not move")
    parser.add_argument("--up", choices=UPS, default="y", help="without a pose: the scan's axis that points up")
    parser.add_argument(
        "--noise", type=float, default=0.0, help="standard deviation of a range, unit of the scan (default 0)"
    )
    parser.add_argument("--image", metavar="IMAGE.png", type=Path, help="RGBA picture of the object, to start from")
    parser.add_argument("-n", "--points", type=int, default=5000, help="of the cloud (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the search and the cloud (default %(default)s)")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Complete the scan and write what was found."""
    import json
    import time

    import numpy as np

    from ddf.api import completion
    from ddf.cli import image_files
    from ddf.core import checks, storage
    from ddf.geometry import mesh_io

    if args.fixed and args.pose is None:
        raise checks.InputError("--fixed needs --pose: a pose that is not given cannot stay")
    pose = None
    if args.pose is not None:
        try:
            pose = np.array(json.loads(args.pose.read_text(encoding="utf-8")), dtype=np.float64)
        except (ValueError, TypeError, UnicodeDecodeError) as error:
            raise checks.InputError(f"{args.pose}: must hold a 4x4 matrix as JSON ({error})") from error
    started = time.monotonic()
    found = completion.complete(
        args.scan,
        args.model,
        pose,
        refine=not args.fixed,
        up=args.up,
        noise=args.noise,
        image=args.image,
        n=args.points,
        seed=args.seed,
    )
    seconds = time.monotonic() - started
    found.save(args.out)
    for name, chosen in (("seen", found.seen), ("inferred", ~found.seen)):
        storage.write_bytes(args.out / f"{name}.ply", mesh_io.points_ply(found.points[chosen]))
    arrays = {"points": found.points, "seen": found.seen, "spread": found.spread, "residuals": found.residuals}
    storage.write_bytes(args.out / "cloud.npz", image_files.npz(arrays))
    both = np.abs(found.residuals[np.isfinite(found.residuals)])
    result = {
        "pose": found.pose.tolist(),
        "explained": found.explained,
        "residual_median": float(np.median(both)) if len(both) else None,
        "seen": float(found.seen.mean()),
        "spread_median": {
            name: float(np.nanmedian(found.spread[chosen])) if np.isfinite(found.spread[chosen]).any() else None
            for name, chosen in (("seen", found.seen), ("inferred", ~found.seen))
        },
        "seconds": round(seconds, 3),
        "out": args.out.as_posix(),
    }
    storage.write_json(args.out / "completion.json", result)
    verdict = (
        f"{args.out}: {found.explained:.0%} of the hits explained, {found.seen.mean():.0%} of the surface was seen"
    )
    if found.explained < LIKELY:
        verdict += "; WARNING: perhaps another category, pose or unit"
    return result | {"verdict": verdict}
