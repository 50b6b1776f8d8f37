"""What `ddf reconstruct` does with an image."""

import argparse
import time
from typing import Any

import numpy as np
import torch

from ddf.cli import image_files
from ddf.core import checks, storage
from ddf.fields import rendering
from ddf.geometry import point_io, transforms
from ddf.reconstruction import one_image
from ddf.report import field_pictures


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Reconstruct the object of the image; write cloud.ply, camera.json, visibility.png, depth.png, normals.png."""
    if args.points < 2 or args.size < 1:
        raise checks.InputError(f"--points must be >= 2 and --size >= 1; got {args.points} and {args.size}")
    model, image_size = one_image.load(args.model)
    deviation = None if args.known is None else one_image.known_deviation(model, args.model, args.known)
    found = one_image.reconstruct(model, image_size, args.image, args.points, args.seed, deviation)
    started = time.monotonic()
    field_scale = torch.tensor(1 / found.scale, device=found.camera.device)
    images, queries = rendering.render(model.field, found.modulations, found.camera, field_scale, args.size)
    seconds = {**found.seconds, "renders": time.monotonic() - started}
    args.out.mkdir(parents=True, exist_ok=True)
    storage.write_bytes(args.out / "cloud.ply", point_io.points_ply(found.scale * found.cloud.cpu().numpy()))
    for name, picture in _pictures(images).items():
        storage.write_bytes(args.out / f"{name}.png", image_files.encode(picture, ".png"))
    azimuth, elevation, radius = (float(x) for x in found.camera)
    result = {
        "camera": {
            "azimuth_deg": float(np.degrees(azimuth)),
            "elevation_deg": float(np.degrees(elevation)),
            "ratio": radius,
        },
        "points": args.points,
        "v1_from_field": transforms.Similarity(found.scale).to_dict(),
        "queries_per_pixel": queries / args.size**2,
        "seconds": {name: round(value, 4) for name, value in seconds.items()},
    }
    storage.write_json(args.out / "camera.json", result)
    return result


def _pictures(found: dict[str, torch.Tensor]) -> dict[str, np.ndarray]:
    arrays = {name: values.cpu().numpy() for name, values in found.items()}
    return {
        "visibility": field_pictures.visibility_picture(arrays["visibility"]),
        "depth": field_pictures.depth_picture(arrays["depth"], arrays["visibility"]),
        "normals": field_pictures.normals_picture(arrays["normals"], arrays["visibility"]),
    }
