"""`ddf render`: what a camera sees of a fitted field, as a picture or as arrays; one query per pixel, or fewer."""

import argparse
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddf.cli import arguments, image_files
from ddf.fields import field_outputs

if TYPE_CHECKING:
    import numpy as np

    from ddf.fields import framed_field

EXAMPLES = (
    "ddf render rabbit rabbit.png",
    "ddf render rabbit turn.webp --turn 36",
    "ddf render rabbit normals.webp --output normals --camera -30,20 --size 512",
    "ddf render rabbit seen.npz --output visibility,depth,normals",
    "ddf render rabbit depth16.png --bits 16",
)
_LARGEST = 8192  # pixels a side
_FRAME_MS = 80


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare field, file and camera."""
    suffixes = (*image_files.PICTURES, *image_files.ARRAYS)
    arguments.add_field(parser)
    arguments.add_out(
        parser, "out", "OUT", f"{', '.join(suffixes)}: a picture of one output, or the numbers of several (npz, exr)"
    )
    parser.add_argument(
        "--camera",
        metavar="AZ,EL[,R]",
        type=camera,
        default="35,25",
        help="azimuth and elevation in degrees, and the distance from the box's centre with 0.57 for one diagonal of "
        "the box; without it the box fills the picture, and what is seen a shaded one (default %(default)s)",
    )
    arguments.add_picture(parser, _LARGEST, "a picture", None)
    parser.add_argument(
        "--turn",
        metavar="N",
        type=arguments.whole_number(2, 360),
        help="a shaded picture that moves: N around the field",
    )
    parser.add_argument(
        "--bits",
        type=int,
        choices=(8, 16),
        default=8,
        help="16: a PNG of depth holds the numbers, depth = value x step, 0 where nothing is seen (default 8: colours)",
    )
    parser.add_argument(
        "--up", choices=arguments.UP_AXES, default="y", help="axis of the mesh that points up (default %(default)s)"
    )


def camera(text: str) -> tuple[float, float, float | None]:
    """The type of --camera: azimuth, elevation and, if given, radius."""
    try:
        azimuth, elevation, *radius = (float(part) for part in text.split(","))
        (distance,) = radius or [None]
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"must be two or three numbers az,el[,r]; got {text!r}") from error
    return azimuth, elevation, distance


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Render and write the file; returns range and unit of what was drawn, and how many rays were evaluated."""
    suffix = args.out.suffix.lower()
    if args.outputs is None:
        numbers = suffix not in image_files.PICTURES or args.bits == 16
        args.outputs = ("depth",) if numbers else (arguments.SHADED,)
    _check(suffix, args)
    if args.outputs == (arguments.SHADED,):
        return _shaded(suffix, args)
    from ddf.cli.field import load
    from ddf.fields import framed_field

    shape = load.framed(args.field, args.outputs)
    azimuth, elevation, radius = args.camera
    if radius is None:
        radius = framed_field.framing_radius(shape, azimuth, elevation, args.up)
    started = time.monotonic()
    images, evaluated = _images(shape, (azimuth, elevation, radius), args)
    seconds = time.monotonic() - started
    drawn = {name: images[name] for name in args.outputs}
    seen = images["visibility"] >= framed_field.SEEN
    result = {
        "output": ",".join(args.outputs),
        "range": {
            name: _range(values, seen) | {"unit": field_outputs.OUTPUTS[name].unit} for name, values in drawn.items()
        },
        "camera": {"azimuth_deg": azimuth, "elevation_deg": elevation, "radius": radius},
        "pixels": args.size**2,
        "evaluated": evaluated,
        "saved": args.size**2 - evaluated,
        "seen": int(seen.sum()),
        "seconds": round(seconds, 4),
        "out": args.out.as_posix(),
    }
    step = _write(args, suffix, drawn, images)
    if step is not None:
        result["depth_step"] = step
    return result | _words(result, args)


def _check(suffix: str, args: argparse.Namespace) -> None:
    """Raise when the file cannot hold what is asked for."""
    from ddf.core import checks

    if suffix not in (*image_files.PICTURES, *image_files.ARRAYS):
        known = ", ".join((*image_files.PICTURES, *image_files.ARRAYS))
        raise checks.InputError(f"{args.out}: must end in one of {known}")
    shaded = args.outputs == (arguments.SHADED,)
    if shaded and suffix not in image_files.PICTURES:
        raise checks.InputError(f"{args.out}: {arguments.SHADED} is a picture: {', '.join(image_files.PICTURES)}")
    if args.turn is not None and not shaded:
        raise checks.InputError(f"--turn goes with --output {arguments.SHADED}; got {','.join(args.outputs)}")
    if suffix in image_files.PICTURES and len(args.outputs) > 1:
        raise checks.InputError(f"{args.out}: a picture shows one output, .npz and .exr hold {len(args.outputs)}")
    if args.bits == 16 and (suffix != ".png" or args.outputs != ("depth",)):
        raise checks.InputError("--bits 16 is for the depth in a .png; .npz and .exr hold numbers of any output")


def _shaded(suffix: str, args: argparse.Namespace) -> dict[str, Any]:
    """Draw and write the pictures of `shaded`; returns how many rays were evaluated."""
    import numpy as np

    from ddf.cli.field import load
    from ddf.core import storage
    from ddf.fields import framed_field, scene_field
    from ddf.pictures import shaded

    shape = scene_field.Counted(load.framed(args.field, ("depth", "normals")))
    azimuth, elevation, radius = args.camera
    turned = [azimuth + 360.0 * i / (args.turn or 1) for i in range(args.turn or 1)]
    framed = radius is None
    far = max(framed_field.framing_radius(shape, each, elevation, args.up) for each in turned) if framed else radius
    started = time.monotonic()
    seen_by, standing = [(each, elevation, far) for each in turned], shaded.stand(shape, args.up)
    shown = shaded.window(standing, seen_by) if framed else shaded.WHOLE
    frames = [shaded.render(standing, each, args.size, shown) for each in seen_by]
    seconds = time.monotonic() - started
    pictures = [frame.picture for frame in frames]
    storage.write_bytes(args.out, image_files.encode_frames(pictures, suffix, _FRAME_MS))
    evaluated, pixels = shape.queries, len(frames) * args.size**2
    seen = float(np.mean([frame.seen for frame in frames]))
    return {
        "output": arguments.SHADED,
        "camera": {"azimuth_deg": azimuth, "elevation_deg": elevation, "radius": far},
        "frames": len(frames),
        "pixels": pixels,
        "evaluated": evaluated,
        "saved": shaded.MOST_RAYS * pixels - evaluated,
        "seen": round(seen * pixels),
        "seconds": round(seconds, 4),
        "out": args.out.as_posix(),
        "verdict": f"{args.out}: {f'{len(frames)} x ' if args.turn else ''}{args.size} x {args.size} pixels, "
        f"{seen:.0%} of them see the object from {azimuth:g},{elevation:g},{far:.3g}; "
        f"{evaluated:,} rays in {seconds:.2f} s",
    }


def _images(
    shape: "framed_field.FramedField", camera: tuple[float, float, float], args: argparse.Namespace
) -> "tuple[dict[str, np.ndarray], int]":
    """What is asked for and the visibility, and the number of rays evaluated."""
    from ddf.fields import framed_field

    return framed_field.render(shape, camera, args.size, {"visibility", *args.outputs}, args.up)


def _range(values: "np.ndarray", seen: "np.ndarray") -> dict[str, float]:
    """Least and largest of what is seen; NaN where nothing is."""
    known = values[seen]
    if not known.size:
        return {"min": float("nan"), "max": float("nan")}
    return {"min": float(known.min()), "max": float(known.max())}


def _write(
    args: argparse.Namespace, suffix: str, drawn: "Mapping[str, np.ndarray]", images: "dict[str, np.ndarray]"
) -> float | None:
    """Write the file; the step of a depth of 16 bits."""
    from ddf.core import storage

    path: Path = args.out
    if suffix == ".exr":
        image_files.write_exr(path, drawn)
    elif suffix == ".npz":
        storage.write_bytes(path, image_files.npz(drawn))
    elif args.bits == 16:
        data, step = image_files.depth_png(drawn["depth"])
        storage.write_bytes(path, data)
        return step
    else:
        from ddf.pictures import field_pictures

        (name,) = drawn
        storage.write_bytes(path, image_files.encode(field_pictures.picture(name, images), suffix))
    return None


def _words(result: Mapping[str, Any], args: argparse.Namespace) -> dict[str, Any]:
    """The table and the verdict."""
    from ddf.cli import results

    rows = [(name, found["min"], found["max"], found["unit"]) for name, found in result["range"].items()]
    view = result["camera"]
    verdict = (
        f"{args.out}: {args.size} x {args.size} pixels, {result['seen'] / result['pixels']:.0%} of them see the object "
        f"from {view['azimuth_deg']:g},{view['elevation_deg']:g},{view['radius']:.3g}; "
        f"{result['evaluated']:,} rays in {result['seconds']:.2f} s"
    )
    if "depth_step" in result:
        verdict += f"; depth = value x {result['depth_step']:.6g}, 0 where nothing is seen"
    return {"table": results.grid(("output", "least", "largest", "unit"), rows), "verdict": verdict}
