"""`ddf reconstruct`: camera, cloud and renders from RGBA images with a trained DDF model."""

import argparse
from pathlib import Path
from typing import Any

from ddf.cli import arguments
from ddf.core import shipped_models

EXAMPLES = (
    "ddf reconstruct chair_model/sample_0.png chair my_chair",
    "ddf reconstruct chair_model/sample_0.png chair_model/sample_1.png chair my_chairs",
)
DEFAULT_POINTS, DEFAULT_SIZE = 5000, 256


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare image, model and output folder."""
    parser.add_argument(
        "images", metavar="IMAGE.png", nargs="+", type=Path, help="RGBA images; the alpha is the mask of the object"
    )
    arguments.mark_known(parser, "model", "reconstruction")
    parser.add_argument(
        "model",
        metavar="MODEL",
        type=shipped_models.place,
        help="trained DDF: a name that `ddf models` lists, or artifacts/cpu/train_ddf/chair",
    )
    arguments.add_folder(parser, "gets cloud.ply, camera.json and pictures; of several images, a folder for each")
    parser.add_argument("-n", "--points", type=int, default=DEFAULT_POINTS, help="of the cloud (default %(default)s)")
    parser.add_argument("--size", type=int, default=DEFAULT_SIZE, help="of the renders, pixels (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the cloud (default %(default)s)")
    parser.add_argument(
        "--known",
        metavar="POINTCLOUDS",
        type=Path,
        help="what stage pointclouds made with the model (artifacts/cpu/pointclouds/chair), which tells how shapes "
        "vary: the shape then moves until its silhouette agrees with the image",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Reconstruct the object of the image."""
    from ddf.cli.model import reconstruct_image

    return reconstruct_image.run(args)
