"""`ddf generate`: new shapes of a trained model, what they look like, and what lies between two of them."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddf.cli import arguments

if TYPE_CHECKING:
    import torch

    from ddf.fields import shape_field
    from ddf.pictures import field_pictures, picture_strips
    from ddf.reconstruction import sampler

EXAMPLES = (
    "ddf generate chair new_chairs",
    "ddf generate artifacts/generative/train_gan/car new_cars -n 4 --seed 1",
)
_MOST = 1000
_BETWEEN = 6  # shapes of the interpolation, both ends among them
_SIZE, _PER_LINE = 192, 4  # pixels a side of a picture; pictures beside each other
_CAMERA = (-35.0, 20.0)  # azimuth and elevation, degrees


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare model, folder, number and seed."""
    parser.add_argument(
        "model",
        metavar="MODEL",
        type=Path,
        help="chair, plane or car, or a folder that stage train_ddf, train_vae or train_gan wrote",
    )
    arguments.add_folder(parser, "gets a folder with a field and pictures for each sample, and sheets of all")
    parser.add_argument(
        "-n", "--samples", type=arguments.whole_number(1, _MOST), default=8, help="how many (default %(default)s)"
    )
    parser.add_argument(
        "--seed", type=arguments.whole_number(0), default=0, help="the same seed gives the same (default %(default)s)"
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Draw latents, write their fields and what they look like."""
    from ddf.cli import image_files
    from ddf.core import shipped_models, storage
    from ddf.fields import shape_field
    from ddf.models import generated_images
    from ddf.pictures import picture_strips
    from ddf.reconstruction import sampler

    path = shipped_models.require(args.model, "reconstruction")
    model = sampler.load(path.parent if path.is_file() else path)
    latents = generated_images.latents(args.samples, model.features, args.seed, "samples")
    features = model.images.config.texture_features if model.images else 0
    textures = generated_images.latents(args.samples, features, args.seed, "textures")
    shapes = [model.decode(latent) for latent in latents]
    looks = [_look(model, *pair) for pair in zip(shapes, textures, strict=True)]
    for number, (shape, seen) in enumerate(zip(shapes, looks, strict=True)):
        folder = args.out / f"{number:03d}"
        shape_field.save(shape, folder, {"fingerprint": "", "seed": args.seed, "sources": {}})
        for name, picture in seen.items():
            storage.write_bytes(folder / f"{name}.png", image_files.encode(picture, ".png"))
    made = {"samples": _rows(looks)}
    if args.samples > 1:
        ends = [generated_images.between((each[0], each[1]), _BETWEEN) for each in (latents, textures)]
        steps = [_look(model, model.decode(latent), texture) for latent, texture in zip(*ends, strict=True)]
        made["between"] = _rows(steps, _BETWEEN)
    for name, rows in made.items():
        storage.write_bytes(args.out / f"{name}.webp", picture_strips.sheet(rows, _SIZE))
    first = (args.out / "000").as_posix()
    return {
        "samples": [f"{number:03d}" for number in range(args.samples)],
        "sheets": [f"{name}.webp" for name in made],
        "images": bool(features),
        "seed": args.seed,
        "out": args.out.as_posix(),
        "verdict": f"{args.out}: {args.samples} samples; each opens as a field: ddf render {first} OUT.png",
    }


def _look(
    model: "sampler.Sampler", shape: "shape_field.ShapeField", texture: "torch.Tensor"
) -> "dict[str, field_pictures.Picture]":
    """The shape under a lamp and, of an image GAN, its image with that texture."""
    from ddf.fields import framed_field
    from ddf.models import generated_images
    from ddf.pictures import field_pictures, shaded

    camera = (*_CAMERA, framed_field.framing_radius(shape, *_CAMERA))
    standing = shaded.stand(shape)
    found = {"shape": shaded.render(standing, camera, _SIZE, shaded.window(standing, [camera])).picture}
    if model.images is not None:
        (seen_from,) = generated_images.cameras_around(1, generated_images.ELEVATION_DEG, generated_images.RADIUS)
        (image,) = generated_images.look(model.images, shape.field, seen_from, texture[None]).colours
        found["image"] = field_pictures.to_bytes(image.permute(1, 2, 0).cpu().numpy())
    return found


def _rows(
    looks: "Sequence[dict[str, field_pictures.Picture]]", per_line: int = _PER_LINE
) -> "list[picture_strips.Row]":
    """Lines of shapes, each above that of its images."""
    import numpy as np

    lines = [looks[start : start + per_line] for start in range(0, len(looks), per_line)]
    return [
        ("", np.stack([each[name].transpose(2, 0, 1) / 255 for each in line])) for line in lines for name in looks[0]
    ]
