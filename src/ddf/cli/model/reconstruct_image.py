"""What `ddf reconstruct` does with its images."""

import argparse
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ddf.cli import image_files
from ddf.core import checks, storage
from ddf.fields import rendering
from ddf.geometry import point_io, transforms
from ddf.models.reconstruction import familiarity, one_image, reconstruction_models, trained
from ddf.pictures import field_pictures
from ddf.training import training_loop


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Reconstruct the object of each image; write cloud.ply, camera.json, visibility.png, depth.png, normals.png."""
    if args.points < 2 or args.size < 1:
        raise checks.InputError(f"--points must be >= 2 and --size >= 1; got {args.points} and {args.size}")
    outs = _folders(args.images, args.out)
    model, image_size = one_image.load(args.model)
    deviation = None if args.known is None else one_image.known_deviation(model, args.model, args.known)
    known = trained.known(args.model.parent if args.model.name == training_loop.MODEL else args.model)
    results = []
    for image, out in zip(args.images, outs, strict=True):
        found = one_image.reconstruct(model, image_size, image, args.points, args.seed, deviation, known)
        results.append(_write(model, found, out, args.size) | {"image": image.as_posix(), "out": out.as_posix()})
    if len(results) == 1:
        return results[0] | {"verdict": _verdict(results[0])}
    return {"images": results, "table": [_verdict(result) for result in results], "verdict": f"{len(results)} images"}


def _folders(images: Sequence[Path], out: Path) -> list[Path]:
    """Where each image's files go: the folder itself, or one below it named as the image.

    Raises:
      InputError: two images have one name.
    """
    names = [image.stem for image in images]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise checks.InputError(f"two images are called {twice[0]!r}, and so would be their folders; rename one")
    return [out] if len(images) == 1 else [out / name for name in names]


def _verdict(result: Mapping[str, Any]) -> str:
    """One line: camera, cloud, and how far the image lies from those of training."""
    view, share = result["camera"], result["unlike_training"]
    seconds = sum(result["seconds"].values())
    line = (
        f"{result['out']}: {result['points']:,} points of {result['image']}, seen from "
        f"{view['azimuth_deg']:.0f},{view['elevation_deg']:.0f},{view['ratio']:.2f} in {seconds:.1f} s"
    )
    if share is None:
        return f"{line}; the model does not say what its training images were like"
    if share < familiarity.FAR:
        return f"{line}; {share:.0%} of the training images lie nearer to each other"
    return f"{line}; WARNING: unlike {share:.1%} of the training images: perhaps no object of the model's category"


def _write(
    model: reconstruction_models.DDFModel, found: one_image.Reconstructed, out: Path, size: int
) -> dict[str, Any]:
    """Render what was found and write all files; what camera.json says."""
    started = time.monotonic()
    field_scale = torch.tensor(1 / found.scale, device=found.camera.device)
    images, queries = rendering.render(model.field, found.modulations, found.camera, field_scale, size)
    seconds = {**found.seconds, "renders": time.monotonic() - started}
    out.mkdir(parents=True, exist_ok=True)
    storage.write_bytes(out / "cloud.ply", point_io.points_ply(found.scale * found.cloud.cpu().numpy()))
    for name, picture in _pictures(images).items():
        storage.write_bytes(out / f"{name}.png", image_files.encode(picture, ".png"))
    azimuth, elevation, radius = (float(x) for x in found.camera)
    result = {
        "camera": {
            "azimuth_deg": float(np.degrees(azimuth)),
            "elevation_deg": float(np.degrees(elevation)),
            "ratio": radius,
        },
        "points": len(found.cloud),
        "unlike_training": found.quantile,
        "v1_from_field": transforms.Similarity(found.scale).to_dict(),
        "queries_per_pixel": queries / size**2,
        "seconds": {name: round(value, 4) for name, value in seconds.items()},
    }
    storage.write_json(out / "camera.json", result)
    return result


def _pictures(found: dict[str, torch.Tensor]) -> dict[str, np.ndarray]:
    arrays = {name: values.cpu().numpy() for name, values in found.items()}
    return {
        "visibility": field_pictures.visibility_picture(arrays["visibility"]),
        "depth": field_pictures.depth_picture(arrays["depth"], arrays["visibility"]),
        "normals": field_pictures.normals_picture(arrays["normals"], arrays["visibility"]),
    }
