"""What several commands share: arguments that mean the same, and pictures as PNG, how clouds are drawn."""

import argparse
import dataclasses
import io
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from ddf.fields import cloud_projection
from ddf.reconstruction import silhouettes

CLOUD = cloud_projection.CloudConfig(  # as configs/cpu.yaml draws them, but for its mirror: `cloud_of`
    num_directions=16,
    cycles=3,
    oversampling=0.1,
    jitter=0.2,
    resample=0.5,
    recheck=(0.1,),
    spread=0.75,
    least_confidence=0.1,
    crowding=1.0,
    centre=4.0,
    temperature=0.05,
    inverse_depth=0.05,
    chunk_rays=2048,
)
MIRRORED_OVERSAMPLING = -0.175  # of configs/cpu.yaml: fewer hits, and their mirror images
SCALE_QUANTILE = 0.002  # likewise
SHAPE_CORRECTION = silhouettes.ShapeCorrectionConfig(  # likewise
    steps=20, learning_rate=0.03, camera_rate=0.03, keep=0.003, mask_size=32
)


def cloud_of(mirror: Literal["x", "y", "z"] | None) -> cloud_projection.CloudConfig:
    """How clouds of a field are drawn that takes shapes for all but symmetric about the plane with this normal."""
    return CLOUD if mirror is None else dataclasses.replace(CLOUD, mirror=mirror, oversampling=MIRRORED_OVERSAMPLING)


def add_field(parser: argparse.ArgumentParser) -> None:
    """The fitted field that a command reads."""
    parser.add_argument(
        "field", metavar="FIELD", type=Path, help="folder that `ddf fit` wrote, or its model.safetensors"
    )


def add_rays(parser: argparse.ArgumentParser, frame: str) -> None:
    """The rays that a command reads with `ray_io`; frame: whose frame they are in."""
    parser.add_argument(
        "--rays",
        metavar="RAYS.npz",
        type=Path,
        required=True,
        help=f"positions, directions: (N, 3), in the {frame}'s frame",
    )


def png(picture: UInt8[np.ndarray, "height width 3"]) -> bytes:
    """A picture as the bytes of a PNG file."""
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, format="PNG")
    return buffer.getvalue()
