"""What `ddf reconstruct` does with an image."""

import argparse
import contextlib
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from ddf.cli import cloud_settings, image_files
from ddf.core import checks, storage
from ddf.data import shapenet
from ddf.fields import cloud_projection, rendering
from ddf.geometry import cameras, point_io, transforms
from ddf.reconstruction import inference, reconstruction_models, scales, settings, silhouettes, trained
from ddf.report import field_pictures
from ddf.training import training_loop

CLOUDS = "ddf.safetensors"  # in the folder of stage `pointclouds`


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Reconstruct the object of the image; write cloud.ply, camera.json, visibility.png, depth.png, normals.png."""
    if args.points < 2 or args.size < 1:
        raise checks.InputError(f"--points must be >= 2 and --size >= 1; got {args.points} and {args.size}")
    folder = args.model.parent if args.model.name == training_loop.MODEL else args.model
    model, image_size = load(folder)
    deviation = None if args.known is None else _deviation(model, folder, args.known)
    image = shapenet.read_any_image(args.image, image_size)[None].to(training_loop.device())
    seconds: dict[str, float] = {}
    with _timed(seconds, "encoders"), torch.no_grad():
        _, latent, seen_from = inference.encode_batch(model, image, mirror_of(model))
    drawn = cloud_settings.cloud(model.field.config.mirror)
    if deviation is not None:
        with _timed(seconds, "silhouette"):
            how = settings.ShapeCorrectionConfig(**cloud_settings.SHAPE_CORRECTION)
            generator = torch.Generator(training_loop.device()).manual_seed(args.seed)
            given = (model, latent, drawn, cloud_settings.SCALE_QUANTILE, [generator])
            field_scale = inference.rough_field_scales(*given)
            alpha = functional.interpolate(image[:, 3:], (how.mask_size, how.mask_size), mode="area")[:, 0]
            latent = silhouettes.correct_shapes(model, latent, deviation, seen_from, field_scale, alpha, how)
    camera, modulations = seen_from[0], [m[0].detach() for m in model.modulations(latent)]
    with _timed(seconds, "cloud"):
        generator = torch.Generator(training_loop.device()).manual_seed(args.seed)
        cycles = cloud_projection.sample(model.field, modulations, args.points, drawn, generator)
        (cloud,) = cloud_projection.select(cycles, [args.points], drawn)
    scale = scales.scale_from_cycles(cycles, cloud_settings.SCALE_QUANTILE)
    with _timed(seconds, "renders"):
        field_scale = torch.tensor(1 / scale, device=camera.device)
        images, queries = rendering.render(model.field, modulations, camera, field_scale, args.size)
    args.out.mkdir(parents=True, exist_ok=True)
    storage.write_bytes(args.out / "cloud.ply", point_io.points_ply(scale * cloud.cpu().numpy()))
    for name, picture in _pictures(images).items():
        storage.write_bytes(args.out / f"{name}.png", image_files.encode(picture, ".png"))
    azimuth, elevation, radius = (float(x) for x in camera)
    result = {
        "camera": {
            "azimuth_deg": float(np.degrees(azimuth)),
            "elevation_deg": float(np.degrees(elevation)),
            "ratio": radius,
        },
        "points": args.points,
        "v1_from_field": transforms.Similarity(scale).to_dict(),
        "queries_per_pixel": queries / args.size**2,
        "seconds": {name: round(value, 4) for name, value in seconds.items()},
    }
    storage.write_json(args.out / "camera.json", result)
    return result


def _deviation(model: reconstruction_models.DDFModel, folder: Path, known: Path) -> Float[Tensor, "z"]:
    """How latents of the model vary between the training images that stage `pointclouds` encoded.

    Raises:
      FileNotFoundError: no such file. InputError: it is damaged, or was made with another model.
    """
    file = known / CLOUDS if known.is_dir() else known
    tensors, record = storage.load_tensors(file, "torch")
    made_with = storage.checksum(folder / training_loop.MODEL)
    if made_with not in record.get("sources", {}).values() or "train_features" not in tensors:
        raise checks.InputError(f"{file}: was not made with the model in {folder}; run stage pointclouds on it")
    return silhouettes.deviation(model, tensors["train_features"])


def load(folder: Path) -> tuple[reconstruction_models.DDFModel, int]:
    """A trained DDF model and the image size that it takes, from the record inside its file.

    Raises:
      FileNotFoundError: there is no model. InputError: it is damaged, or of another kind.
    """
    record = storage.load_metadata(folder / training_loop.MODEL)
    if record.get("kind") != "ddf":
        raise checks.InputError(f"{folder}: holds no DDF model; give a folder that `make train` wrote under train_ddf/")
    return trained.ddf(folder, record)


def mirror_of(model: reconstruction_models.DDFModel) -> cameras.Mirror | None:
    """Normal of the plane about which the model holds shapes for all but symmetric, where flipped images show it."""
    axis = model.field.config.mirror
    return None if axis == "y" else axis


def _pictures(found: dict[str, torch.Tensor]) -> dict[str, np.ndarray]:
    arrays = {name: values.cpu().numpy() for name, values in found.items()}
    return {
        "visibility": field_pictures.visibility_picture(arrays["visibility"]),
        "depth": field_pictures.depth_picture(arrays["depth"], arrays["visibility"]),
        "normals": field_pictures.normals_picture(arrays["normals"], arrays["visibility"]),
    }


@contextlib.contextmanager
def _timed(table: dict[str, float], name: str) -> Iterator[None]:
    """Note the wall time of a block in a table."""
    started = time.monotonic()
    yield
    table[name] = time.monotonic() - started
