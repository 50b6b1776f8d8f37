"""Commands about trained models: the shipped ones, a thing from an image or a scan, new shapes, files of a model."""

import csv
import dataclasses
import re
import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast

from ddf.cli import arguments, results
from ddf.cli.arguments import ModelPath, OutFolder, Points, Seed
from ddf.cli.declare import Arg, command
from ddf.core import errors, shipped_models

if TYPE_CHECKING:
    import torch

    from ddf.api import completion
    from ddf.fields import shape_field
    from ddf.geometry import scans
    from ddf.pictures import field_pictures, picture_strips
    from ddf.reconstruction import sampler

BATCHES = (1, 7, 65536)  # rays that an ONNX file and its model are compared with
_INTERPOLATED = 6  # shapes between two samples, both ends among them
_SIZE, _PER_LINE = 192, 4  # pixels a side of a picture of a sample; pictures beside each other
_CAMERA = (-35.0, 20.0)  # of these: azimuth and elevation, degrees
_SOURCES, _CARD = "sources.csv", "card.md"  # beside a shipped model
_FEW_HITS = 200  # of a scan, under which the share that was seen means nothing
_BESIDE = 50.0  # degrees from the sensor to who looks at the picture
_COMPLETED = ("seen.ply", "inferred.ply", "cloud.npz", "picture.png", "completion.json")
_AGREES = 0.85  # overlap of the outlines of a reconstruction and its picture, under which a line warns


@command("model", actions="[get NAME OUT]")
def models() -> dict[str, Any]:
    """The trained models and fields that come with the package.

    `ddf models get NAME OUT` copies one, with its card and sample images. A name of the list stands wherever a command
    takes a FIELD or a MODEL of its kind.

    Examples:
      ddf models
      ddf models get chair chair_model
    """
    listed = shipped_models.listed()
    rows = [(m.name, m.kind, f"{m.num_bytes / 1e6:.1f} MB", m.summary) for m in listed]
    licences = {m.name: _licences(m.folder / _SOURCES) for m in listed if _SOURCES in m.files}
    said = [f"{name}: shapes of {', '.join(f'{k} {v}' for k, v in own.items())}" for name, own in licences.items()]
    credits = [*said, f"who made each: {shipped_models.ROOT.as_posix()}/NAME/{_SOURCES}"] if said else []
    return {
        "models": [
            {
                "name": m.name,
                "kind": m.kind,
                "path": m.folder.as_posix(),
                "bytes": m.num_bytes,
                "summary": m.summary,
                "files": sorted(m.files),
                "licences": licences.get(m.name, {}),
            }
            for m in listed
        ],
        "table": [*results.grid(("name", "kind", "size", "what"), rows), *credits],
        "verdict": f"{len(listed)} models; a name stands wherever a command takes a FIELD or a MODEL of its kind",
    }


def _licences(table: Path) -> dict[str, int]:
    """How many shapes of other people trained a model, by licence, the most first."""
    with table.open(encoding="utf-8", newline="") as lines:
        return dict(Counter(row["licence"] for row in csv.DictReader(lines)).most_common())


@models.action("get")
def models_get(name: Annotated[str, Arg("NAME")], out: Annotated[Path, Arg("OUT", writes="folder")]) -> dict[str, Any]:
    """Copy the files of a model to a folder.

    Args:
      name: of the list that `ddf models` prints.
      out: files of the same name are replaced.
    """
    from ddf.core import storage

    listed = {model.name: model for model in shipped_models.listed()}
    if name not in listed:
        raise errors.InputError(f"no model is called {name!r}; there are {errors.known_names(name, listed)}")
    model = listed[name]
    for file in model.files:
        storage.write_bytes(out / file, (model.folder / file).read_bytes())
    return {
        "name": name,
        "kind": model.kind,
        "bytes": model.num_bytes,
        "files": sorted(model.files),
        "verdict": f"{len(model.files)} files of {name} in {out}",
    }


@command("model", api="reconstruction:reconstruct")
def reconstruct(
    images: Annotated[list[Path], Arg("IMAGE")],
    model: ModelPath,
    out: OutFolder,
    *,
    mask: Annotated[Path | None, Arg("FILE")] = None,
    background: Annotated[str, Arg("HOW")] = "auto",
    points: Points = 5000,
    seed: Seed = 0,
    together: bool = False,
    cameras: Annotated[Path | None, Arg("FILE")] = None,
) -> dict[str, Any]:
    """Field, mesh, cloud and camera from a picture with a trained model.

    - The object may stand anywhere in the picture: it is framed as the training images are.
    - The folder is a field for every other command. `shape.glb` has the picture as its texture, `picture.png` shows
      both from four sides.
    - Several pictures before the model get a folder each; with `--together` they show one object.
    - The verdict: `like the training images`, `unusual: expect errors` (beyond 90 % of them), or `no chair` (beyond
      95 %).

    Args:
      images: pictures of one object each: PNG, WebP, JPEG, GIF or BMP.
      out: gets the field, shape.glb, shape.ply, cloud.ply, camera.json and picture.png; of several pictures, a folder
        for each.
      together: the pictures are of one object, for a model of train_ddf_image; all files are in `OUT`.
      cameras: of the pictures, JSON or transforms.json (docs/formats.md); without it they are predicted.

    Examples:
      ddf reconstruct chair_model/sample_0.png chair my_chair
      ddf reconstruct chair_model/sample_0.png chair_model/sample_1.png chair my_chairs
      ddf reconstruct 1.png 2.png 3.png artifacts/real/train_ddf_image/chair mine --together --cameras transforms.json
    """
    from ddf import cli
    from ddf.api import reconstruction

    if mask is not None and len(images) > 1:
        raise errors.InputError("--mask is of one picture; give one")
    if cameras is not None and len(images) > 1 and not together:
        raise errors.InputError("--cameras is of one picture or, with --together, of several of one object")
    groups = [images] if together else [[image] for image in images]
    outs = [out] if together else _folders(images, out)
    for folder in outs:
        _require_free(folder, reconstruction.FILES)
    results.show_parts()
    of = reconstruction.reconstructor(model)
    made = []
    for number, (group, folder) in enumerate(zip(groups, outs, strict=True), 1):
        if len(groups) > 1:
            sys.stderr.write(f"{group[0]}: {number} of {len(groups)}\n")
        found = of(group, points, seed, mask, background, cameras).save(folder)
        made.append(found | {"image": group[0].as_posix(), "out": folder.as_posix()})
    rates = _rates(model)
    lines = [_line(result, group, rates) for result, group in zip(made, groups, strict=True)]
    seconds = round(time.monotonic() - cli.STARTED, 1)
    found = {"command_seconds": seconds, "table": lines, "verdict": f"{len(made)} pictures after {seconds} s"}
    alone = {"table": {}, "verdict": f"{lines[0]} after {seconds} s"}
    return found | {"images": made} | (made[0] | alone if len(made) == 1 else {})


def _require_free(folder: Path, files: Sequence[str]) -> None:
    """InputError where files of a folder would replace what is read, or a fit, whose fit.json would stay."""
    from ddf.core import storage
    from ddf.fit import fit_folder

    for name in files:
        storage.require_not_read(folder / name)
    if (folder / fit_folder.METRICS).exists():
        raise errors.InputError(f"{folder}: holds the field of a fit; give another folder")


def _folders(images: Sequence[Path], out: Path) -> list[Path]:
    """Where each picture's files go: the folder itself, or one below it named as the picture."""
    names = [image.stem for image in images]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise errors.InputError(f"two images are called {twice[0]!r}, and so would be their folders; rename one")
    return [out] if len(images) == 1 else [out / name for name in names]


def _rates(model: Path) -> tuple[str, str]:
    """How often the verdict is wrong, both ways, as the model's card says; empty where it does not."""
    folder = shipped_models.place(model)
    card = (folder.parent if folder.is_file() else folder) / _CARD
    text = card.read_text(encoding="utf-8") if card.is_file() else ""
    found = re.search(r"calls no \w+: (\d+%) of (\d+ \w+), (.+), of shapes", text)
    if found is None:
        return "", ""
    passed = [100 - int(share) for share in re.findall(r"(\d+)%", found[3])]
    return f"so are {found[1]} of {found[2]}", f"{min(passed)} to {max(passed)}% of other things pass too"


def _line(result: Mapping[str, Any], images: Sequence[Path], rates: tuple[str, str]) -> str:
    from ddf.models import out_of_distribution

    view = result["camera"]
    overlaps = zip(images, (each["silhouette_iou"] for each in result["cameras"]), strict=True)
    far = ", ".join(f"{image.name} by {overlap:.2f}" for image, overlap in overlaps if overlap < _AGREES)
    doubt = f"; its outline is not the picture's: they overlap in {far}" if far else ""
    unlike = result["unlike_training"] or 0.0
    bound = out_of_distribution.FAR if unlike >= out_of_distribution.FAR else out_of_distribution.UNUSUAL
    told = [f"unlike_training {unlike:.2f}, bound {bound:.2f}"] if unlike >= bound else []
    told += [rate for rate in [rates[unlike < out_of_distribution.FAR]] if rate]
    by = f" ({'; '.join(told)})" if told else ""
    return (
        f"{result['image']}: {result['verdict']}{by}; seen from {view['azimuth_deg']:.0f},{view['elevation_deg']:.0f},"
        f"{view['radius']:.2f}; {result['points']:,} points and {result['faces']:,} triangles in {result['out']}{doubt}"
    )


@command("model", api="completion:complete")
def complete(
    scan: Annotated[Path, Arg("SCAN")],
    model: ModelPath,
    out: OutFolder,
    *,
    pose: Annotated[Path | None, Arg("POSE.json")] = None,
    fixed: bool = False,
    up: Literal["y", "z", "-y"] | None = None,
    noise: float = 0.0,
    image: Annotated[Path | None, Arg("IMAGE.png")] = None,
    points: Points = 5000,
    seed: Seed = 0,
) -> dict[str, Any]:
    """The whole object, and its pose, from a depth image or a lidar scan of it.

    [Completing](complete.md) tells what a scan is.

    Args:
      scan: NPZ of rays with ranges, of a depth image or of points with sensors; or a depth PNG: docs/complete.md.
      out: gets model.safetensors, seen.ply, inferred.ply, cloud.npz, picture.png, completion.json.
      pose: 4x4, where the object's box lies (default: found by itself).
      fixed: the pose is known, and does not move.

    Examples:
      ddf complete scan.npz chair whole_chair
      ddf complete scan.npz chair whole_chair --pose pose.json --fixed --noise 0.005
    """
    import numpy as np

    from ddf.api import completion
    from ddf.core import checks, storage
    from ddf.geometry import mesh_io, scans, transforms

    _require_free(out, _COMPLETED)
    if fixed and pose is None:
        raise errors.InputError("--fixed needs --pose: a pose that is not given cannot stay")
    if checks.require_whole("n", points, 2) and not 0 <= noise < np.inf:  # before the line that tells of the work
        raise errors.InputError(f"noise must be 0 or more, in the unit of the scan; got {noise}")
    matrix = None
    if pose is not None:
        matrix = transforms.Similarity.of_matrix(f"{pose}: the pose", storage.read_json(pose)).to_matrix()
    given = scans.read(scan)
    hits, sought = int(given.hit.sum()), "shape, some 12 s" if fixed else "shape and pose, some 20 s"
    sys.stderr.write(f"{hits:,} hits of {len(given.ranges):,} rays; seeks {sought} of a core\n")
    started = time.monotonic()
    found = completion.complete(
        given, model, matrix, refine=not fixed, up=up, noise=noise, image=image, n=points, seed=seed
    )
    seconds = time.monotonic() - started
    found.save(out)
    halves = {"seen": found.seen, "inferred": ~found.seen}
    for name, chosen in halves.items():
        storage.write_bytes(out / f"{name}.ply", mesh_io.points_ply(found.points[chosen]))
    arrays = {"points": found.points, "seen": found.seen, "spread": found.spread, "residuals": found.residuals}
    storage.write_bytes(out / "cloud.npz", results.npz(arrays))
    storage.write_bytes(out / "picture.png", results.encode([_completed(found, given)], ".png"))
    both = np.abs(found.residuals[np.isfinite(found.residuals)])
    result = {
        "pose": found.pose.tolist(),
        "explained": found.explained,
        "likeness": found.likeness,
        "residual_median": float(np.median(both)) if len(both) else None,
        "seen": float(found.seen.mean()) if hits >= _FEW_HITS else None,
        "spread_median": {
            name: float(np.median(found.spread[chosen])) if chosen.any() else None for name, chosen in halves.items()
        },
        "seconds": round(seconds, 3),
        "left_out": list(given.remarks),
    }
    storage.write_json(out / "completion.json", result)
    verdict = f"{out}: {found.explained:.0%} of the hits explained"
    few = f"; {hits} hits are too few to tell how much of the surface was seen"
    verdict += few if result["seen"] is None else f", {result['seen']:.0%} of the surface was seen"
    half, unit = np.cbrt(np.linalg.det(found.pose[:3, :3])), _unit(scan)
    ahead, upright, _ = found.pose[:3, :3].T / half
    turn = np.degrees(np.arctan2(ahead @ np.cross(upright, [1, 0, 0]), ahead[0]))
    verdict += f"; stands at {', '.join(f'{each:.3g}' for each in found.pose[:3, 3])}; turned {turn:.0f} degrees about "
    verdict += f"up; longest side {2 * half:.4g}, {unit}"
    if found.unlike:
        verdict += f"; WARNING: perhaps no {Path(model).name}, or another pose or unit"
    table = {name: result[name] for name in ("explained", "likeness", "residual_median", "spread_median", "seconds")}
    return result | {"table": table, "verdict": verdict + results.left_out(given.remarks)}


def _unit(scan: Path) -> str:
    """Of a scan: steps of grey are millimetres, read as metres, where neither the image nor what lies beside tells."""
    from ddf.core import storage
    from ddf.geometry import scans

    if scan.suffix.lower() != ".png":
        return "units of the scan"
    told = scans.grey(scan)[1] is not None or "depth_scale" in storage.read_json(scan.with_suffix(".json"))
    return "units of the scan" if told else "metres"


def _completed(found: "completion.Completion", given: "scans.Scan") -> "field_pictures.Picture":
    """The scan's hits, points that were seen and inferred, and the surface, upright and from beside the sensor."""
    import numpy as np

    from ddf.geometry import transforms
    from ddf.pictures import completed_pictures

    inside = transforms.Similarity.of_matrix("pose", found.pose).inverse()
    eye, hits, points = map(inside.apply, (given.positions.mean(axis=0), given.points, found.points))
    place = (float(np.degrees(np.arctan2(eye[2], eye[0]))) + _BESIDE, _CAMERA[1])
    colours = np.where(found.seen[:, None], completed_pictures.SEEN, completed_pictures.INFERRED)
    drawn = [(hits, np.tile(completed_pictures.SCAN, (len(hits), 1))), (points, colours)]
    scale = 1.15 * float(np.linalg.norm(np.ptp(points, axis=0)))
    pictures = [completed_pictures.dots(each / scale, colour, 2 * _SIZE, *place) for each, colour in drawn]
    upright: Any = dataclasses.replace(cast("Any", found.field.framed), field_from_mesh=transforms.Similarity())
    return np.concatenate([*pictures, _clay(upright, place, 2 * _SIZE)], axis=1)


@command("model", api="reconstruction:generate")
def generate(
    model: ModelPath,
    out: OutFolder,
    *,
    samples: Annotated[int, Arg(None, ("-n", "--samples"), arguments.whole_number(1, 1000), like="n")] = 8,
    seed: Seed = 0,
) -> dict[str, Any]:
    """Samples of a trained model: fields, normals, and the images of an image GAN.

    Each sample is a field that every other command opens, with a picture. `samples.webp` shows all of them,
    `between.webp` what lies between the first two. `make reproduce-generative` trains further models:
    [generative models](generative.md).

    Args:
      out: gets a folder with a field and pictures for each sample, and sheets of all.

    Examples:
      ddf generate chair new_chairs
      ddf generate artifacts/generative/train_gan/car new_cars -n 4 --seed 1
    """
    from ddf.core import storage
    from ddf.models import generated_images
    from ddf.pictures import picture_strips
    from ddf.reconstruction import sampler

    drawn = sampler.load(model.parent if model.is_file() else model)
    latents = generated_images.latents(samples, drawn.features, seed, "samples")
    features = drawn.images.config.texture_features if drawn.images else 0
    textures = generated_images.latents(samples, features, seed, "textures")
    shapes = [drawn.decode(latent) for latent in latents]
    looks = [_look(drawn, *pair) for pair in zip(shapes, textures, strict=True)]
    for number, (shape, seen) in enumerate(zip(shapes, looks, strict=True)):
        folder = out / f"{number:03d}"
        dataclasses.replace(shape, record={"seed": seed}).save(folder)
        for name, picture in seen.items():
            storage.write_bytes(folder / f"{name}.png", results.encode([picture], ".png"))
    per_line = max(_PER_LINE, -(-samples * len(looks[0]) // 80))  # a WebP has 16,383 lines of pixels at most
    names = [f"{number:03d}" for number in range(samples)]
    made = {"samples": _rows(looks, names, per_line)}
    if samples > 1:
        ends = [generated_images.between((each[0], each[1]), _INTERPOLATED) for each in (latents, textures)]
        steps = [_look(drawn, drawn.decode(latent), texture) for latent, texture in zip(*ends, strict=True)]
        made["between"] = _rows(steps, names[:2], _INTERPOLATED)
    for name, rows in made.items():
        storage.write_bytes(out / f"{name}.webp", picture_strips.sheet(rows, _SIZE))
    return {
        "samples": names,
        "sheets": [f"{name}.webp" for name in made],
        "images": bool(features),
        "seed": seed,
        "verdict": f"{out}: {samples} samples; each opens as a field: ddf render {(out / '000').as_posix()} OUT.png",
    }


def _look(
    model: "sampler.Sampler", shape: "shape_field.ShapeField", texture: "torch.Tensor"
) -> "dict[str, field_pictures.Picture]":
    """The shape under a lamp and, of an image GAN, its image with that texture."""
    from ddf.models import generated_images
    from ddf.pictures import field_pictures

    found = {"shape": _clay(shape, _CAMERA, _SIZE)}
    if model.images is not None:
        (seen_from,) = generated_images.cameras_around(1, generated_images.ELEVATION_DEG, generated_images.RADIUS)
        (image,) = generated_images.look(model.images, shape.field, seen_from, texture[None]).colours
        found["image"] = field_pictures.to_bytes(image.permute(1, 2, 0).cpu().numpy())
    return found


def _clay(shape: "shape_field.ShapeField", place: tuple[float, float], size: int) -> "field_pictures.Picture":
    """The shape under a lamp, from an azimuth and an elevation, degrees."""
    from ddf.fields import framed_field
    from ddf.pictures import shaded

    camera = (*place, framed_field.framing_radius(shape, *place))
    standing = shaded.stand(shape)
    return shaded.render(standing, camera, size, shaded.window(standing, [camera])).picture


def _rows(
    looks: "Sequence[dict[str, field_pictures.Picture]]", names: "Sequence[str]", per_line: int
) -> "list[picture_strips.Row]":
    """Lines of shapes, named by the first and the last, each above that of its images."""
    import numpy as np

    lines = [(looks[i : i + per_line], names[i : i + per_line]) for i in range(0, len(looks), per_line)]
    return [
        (f"{own[0]} to {own[-1]}", np.stack([each[kind].transpose(2, 0, 1) / 255 for each in line]))
        for line, own in lines
        for kind in looks[0]
    ]


@command("model")
def export(
    model: Annotated[Path, Arg("MODEL", parse=shipped_models.place, reads=("field", "reconstruction"))],
    out: Annotated[Path, Arg("OUT", writes="file")],
    *,
    graph: str | None = None,
    outputs: arguments.Outputs | None = None,
) -> dict[str, Any]:
    """A trained model as an ONNX file, checked against onnxruntime.

    [ONNX](onnx.md) tells its inputs.

    Args:
      model: trained model (artifacts/cpu/train_ddf/chair), a folder that `ddf fit` wrote, or a name of `ddf models`.
      out: file to write: .onnx.
      graph: field or encoders of a DDF model, rays or encode of one with image features, such as chair (the first).

    Examples:
      ddf export rabbit field.onnx
      ddf export rabbit small.onnx --outputs depth,visibility
    """
    if out.suffix.lower() != ".onnx":
        raise errors.InputError(f"{out}: must end in .onnx; a page is made by ddf view")
    from ddf.fields import field_outputs, model_files
    from ddf.io import onnx_file

    settings = onnx_file.ExportConfig(field_outputs.DEFAULT, BATCHES)
    folder = model.parent if model.name == model_files.MODEL else model
    graphs, source = onnx_file.load_graphs(folder, outputs)
    name = graph or next(iter(graphs))
    if name not in graphs:
        raise errors.InputError(f"--graph must be one of {', '.join(graphs)} for {folder}; got {name!r}")
    if outputs is not None and name != "field":
        raise errors.InputError(f"--outputs is of the graph field, this one is {name}")
    rows = onnx_file.export(graphs[name], name, out, source, settings)
    parity = onnx_file.figures(rows)
    worst = max(parity, key=lambda output: parity[output]["max_abs"])
    return {
        "graph": name,
        "opset": onnx_file.OPSET,
        "bytes": rows[0].bytes,
        "inputs": {key: list(shape) for key, shape in graphs[name].inputs.items()},
        "parity": parity,
        "table": results.grid(
            ("output", "largest difference", "tolerance"),
            [(output, entry["max_abs"], entry["tolerance"]) for output, entry in parity.items()],
        ),
        "verdict": f"{out}: graph {name}, opset {onnx_file.OPSET}, {rows[0].bytes:,} bytes; "
        f"run by onnxruntime and by torch it differs most in {worst}, by {results.cell(parity[worst]['max_abs'])}",
    }
