"""`ddf reconstruct`: field, mesh, cloud and camera from pictures with a trained DDF model."""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ddf.cli import arguments
from ddf.core import shipped_models

EXAMPLES = (
    "ddf reconstruct chair_model/sample_0.png chair my_chair",
    "ddf reconstruct chair_model/sample_0.png chair_model/sample_1.png chair my_chairs",
)
DEFAULT_POINTS = 5000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare pictures, model and output folder."""
    parser.add_argument(
        "images", metavar="IMAGE", nargs="+", type=Path, help="pictures of one object each: PNG, WebP, JPEG or GIF"
    )
    arguments.mark_known(parser, "model", "reconstruction")
    parser.add_argument(
        "model",
        metavar="MODEL",
        type=shipped_models.place,
        help="trained DDF: a name that `ddf models` lists, or artifacts/cpu/train_ddf/chair",
    )
    arguments.add_folder(
        parser,
        "gets the field, shape.glb, shape.ply, cloud.ply, camera.json and picture.png; of several pictures, a folder "
        "for each",
    )
    parser.add_argument("--mask", metavar="FILE", type=Path, help="a picture that is light on the object")
    parser.add_argument(
        "--background",
        metavar="HOW",
        default="auto",
        help="what the object is cut out by: auto, the picture's alpha, or its rim where it has none; white; border, "
        "the rim; or a colour, #rrggbb (default auto)",
    )
    parser.add_argument("-n", "--points", type=int, default=DEFAULT_POINTS, help="of the cloud (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the cloud (default %(default)s)")
    parser.add_argument(
        "--known",
        metavar="POINTCLOUDS",
        type=Path,
        help="what stage pointclouds made with the model (artifacts/cpu/pointclouds/chair), which tells how shapes "
        "vary: the shape then moves until its silhouette agrees with the picture",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Reconstruct the object of each picture, and write a folder of it."""
    from ddf.api import reconstruction
    from ddf.core import checks

    if args.mask is not None and len(args.images) > 1:
        raise checks.InputError("--mask is of one picture; give one")
    outs = _folders(args.images, args.out)
    of = reconstruction.reconstructor(args.model, args.known)
    results = []
    for image, out in zip(args.images, outs, strict=True):
        found = of(image, args.points, args.seed, args.mask, args.background).save(out)
        results.append(found | {"image": image.as_posix(), "out": out.as_posix()})
    lines = [_line(result) for result in results]
    if len(results) == 1:
        return results[0] | {"table": {}, "verdict": lines[0]}
    return {"images": results, "table": lines, "verdict": f"{len(results)} pictures"}


def _folders(images: Sequence[Path], out: Path) -> list[Path]:
    """Where each picture's files go: the folder itself, or one below it named as the picture.

    Raises:
      InputError: two pictures have one name.
    """
    from ddf.core import checks

    names = [image.stem for image in images]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise checks.InputError(f"two images are called {twice[0]!r}, and so would be their folders; rename one")
    return [out] if len(images) == 1 else [out / name for name in names]


def _line(result: Mapping[str, Any]) -> str:
    """The verdict, the camera, and what was made."""
    view, seconds = result["camera"], sum(result["seconds"].values())
    return (
        f"{result['image']}: {result['verdict']}; seen from {view['azimuth_deg']:.0f},{view['elevation_deg']:.0f},"
        f"{view['radius']:.2f}; {result['points']:,} points and {result['faces']:,} triangles in {result['out']} after "
        f"{seconds:.1f} s"
    )
