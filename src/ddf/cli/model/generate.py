"""`ddf generate`: samples of a shape VAE, with images where the model is an image GAN, and what lies between two."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddf.cli import arguments

if TYPE_CHECKING:
    import torch

    from ddf.fields import pddf
    from ddf.models.generative import image_gans, shape_vae

EXAMPLES = (
    "ddf generate artifacts/generative/train_gan/car new_cars",
    "ddf generate artifacts/generative/train_vae/car new_shapes -n 4 --seed 1",
)
_MOST = 1000
_BETWEEN = 5  # shapes, and textures, of the interpolation


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare model, folder, number and seed."""
    parser.add_argument("model", metavar="MODEL", type=Path, help="folder that stage train_gan or train_vae wrote")
    arguments.add_folder(parser, "gets a folder with a field and pictures for each sample, and sheets of all")
    parser.add_argument(
        "-n", "--samples", type=arguments.whole_number(1, _MOST), default=8, help="how many (default %(default)s)"
    )
    parser.add_argument(
        "--seed", type=arguments.whole_number(0), default=0, help="the same seed gives the same (default %(default)s)"
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Draw latents, write their fields and what they look like."""
    import torch

    from ddf.core import storage
    from ddf.models.generative import normal_images, pictures, shape_vae
    from ddf.pictures import sheets

    model, features = _load(args.model)
    latents = normal_images.latents(args.samples, model.decoder.modulator.layers[0].in_features, args.seed, "samples")
    textures = normal_images.latents(args.samples, features, args.seed, "textures")
    fields = pictures.fields(model.decoder, latents)
    rows: list[tuple[str, list[torch.Tensor]]] = [("normals", []), *([("images", [])] if features else [])]
    record = {"fingerprint": "", "seed": args.seed, "sources": {}}
    for number, field in enumerate(fields):
        folder = args.out / f"{number:03d}"
        shape_vae.write_field(folder, field, float(model.field_scale), record)
        seen = _look(model, field, textures[number : number + 1] if features else None)
        for (name, found), picture in zip(rows, seen, strict=True):
            found.append(picture)
            storage.write_bytes(folder / f"{name.removesuffix('s')}.png", _png(picture))
    made = {"samples": sheets.sheet([(name, torch.stack(found).numpy()) for name, found in rows])}
    if args.samples > 1:
        made["between"] = sheets.sheet(_between(model, latents, textures if features else None))
    for name, data in made.items():
        storage.write_bytes(args.out / f"{name}.webp", data)
    first = (args.out / "000").as_posix()
    return {
        "samples": [f"{number:03d}" for number in range(args.samples)],
        "sheets": [f"{name}.webp" for name in made],
        "images": bool(features),
        "seed": args.seed,
        "out": args.out.as_posix(),
        "verdict": f"{args.out}: {args.samples} samples; each opens as a field: ddf render {first} OUT.png",
    }


def _load(folder: Path) -> "tuple[shape_vae.ShapeVAE | image_gans.ImageGAN, int]":
    """The model, and the features of its textures: 0 of a VAE."""
    from ddf.core import checks, storage
    from ddf.models.generative import image_gans, shape_vae
    from ddf.training import training_loop

    file = folder / training_loop.MODEL
    if not file.is_file():
        raise FileNotFoundError(f"{file}: no such model; give a folder that stage train_gan or train_vae wrote")
    kind = storage.load_metadata(file).get("kind")
    if kind == image_gans.KIND:
        model = image_gans.load(folder)
        return model, model.config.texture_features
    if kind == shape_vae.KIND:
        return shape_vae.load(folder), 0
    raise checks.InputError(
        f"{folder}: holds neither a shape VAE nor an image GAN; give a folder that stage train_gan or train_vae wrote"
    )


def _look(
    model: "shape_vae.ShapeVAE | image_gans.ImageGAN", field: "pddf.PDDF", textures: "torch.Tensor | None"
) -> "list[torch.Tensor]":
    """Normals on white of one shape, and its image of each texture, in [0, 1]."""
    from ddf.models.generative import image_gans, normal_images, pictures

    (camera,) = pictures.cameras_around(1, pictures.ELEVATION_DEG, pictures.RADIUS)
    if isinstance(model, image_gans.ImageGAN) and textures is not None:
        seen = pictures.look(model, field, camera, textures)
        return [pictures.on_white(seen.normals).cpu(), *seen.colours.cpu()]
    normals, _ = normal_images.render(field, model.field_scale, camera)
    return [pictures.on_white(normals).cpu()]


def _between(
    model: "shape_vae.ShapeVAE | image_gans.ImageGAN", latents: "torch.Tensor", textures: "torch.Tensor | None"
) -> "list[tuple[str, Any]]":
    """Rows of the sheet between the first two samples: shapes, and of an image GAN their images of each texture."""
    import torch

    from ddf.models.generative import pictures

    shapes = pictures.fields(model.decoder, pictures.between((latents[0], latents[1]), _BETWEEN))
    mixed = None if textures is None else pictures.between((textures[0], textures[1]), _BETWEEN)
    columns = torch.stack([torch.stack(_look(model, field, mixed)) for field in shapes])
    names = ["normals", *(["textures", *[""] * (_BETWEEN - 1)] if mixed is not None else [])]
    return [(name, columns[:, row].numpy()) for row, name in enumerate(names)]


def _png(picture: "torch.Tensor") -> bytes:
    from ddf.cli import image_files
    from ddf.pictures import field_pictures

    return image_files.encode(field_pictures.to_bytes(picture.permute(1, 2, 0).numpy()), ".png")
