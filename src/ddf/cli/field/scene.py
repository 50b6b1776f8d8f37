"""`ddf scene`: what cameras see of several fields in one scene, as a picture, as moving pictures or as arrays."""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddf.cli import arguments, image_files
from ddf.cli.field.render import camera

if TYPE_CHECKING:
    import numpy as np

    from ddf.api import scene_file
    from ddf.api.scene import Scene
    from ddf.fields import scene_field

EXAMPLES = (
    "ddf scene scene.yaml scene.png",
    "ddf scene scene.yaml normals.webp --output normals --path fly --frames 48",
    "ddf scene scene.yaml around.npz --output visibility,depth,normals --path orbit --frames 8",
)
PATHS = ("orbit", "fly")
_LARGEST, _MOST_FRAMES = 2048, 1000
_FRAME_MS = 80


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare scene, file and cameras."""
    parser.add_argument("scene", metavar="SCENE.yaml", type=Path, help="fields and where they stand: docs/formats.md")
    suffixes = ", ".join((*image_files.PICTURES, ".npz"))
    arguments.add_out(parser, "out", "OUT", f"{suffixes}: pictures of one output, moving on a path; or the numbers")
    parser.add_argument(
        "--camera",
        metavar="AZ,EL[,R]",
        type=camera,
        default="35,25",
        help="as of ddf render, about the scene's box; where a path begins (default %(default)s)",
    )
    parser.add_argument(
        "--path", choices=PATHS, help="orbit: once around the box; fly: along the waypoints of the file, or straight in"
    )
    parser.add_argument(
        "--frames", metavar="N", type=arguments.whole_number(2, _MOST_FRAMES), default=24, help="of a path (default 24)"
    )
    arguments.add_picture(parser, _LARGEST, "pictures")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Render and write the file; returns how many oriented points fields were asked for, and how many were not."""
    suffix = args.out.suffix.lower()
    _check(suffix, args)
    import numpy as np

    from ddf.api import scene_file
    from ddf.core import storage

    content = scene_file.read(args.scene)
    shown, counted = _counted(scene_file.build(content, args.scene.parent))
    cameras = _cameras(shown, content, args)
    started = time.monotonic()
    frames = [_frame(shown, each, args, content.up) for each in cameras]
    seconds = time.monotonic() - started
    stacked = {name: np.stack([frame[name] for frame in frames]) for name in frames[0]}
    if suffix == ".npz":
        arrays = {name: stacked[name] if args.path else stacked[name][0] for name in args.outputs}
        storage.write_bytes(args.out, image_files.npz(arrays))
    else:
        storage.write_bytes(args.out, image_files.encode_frames(_pictures(args.outputs[0], stacked), suffix, _FRAME_MS))
    pixels, asked = args.size**2 * len(frames), sum(field.queries for field in counted)
    saved = pixels * len(counted) - asked  # of every object asked once for every pixel
    result = {
        "objects": len(counted),
        "frames": len(frames),
        "pixels": pixels,
        "queries": asked,
        "queries_per_pixel": asked / pixels,
        "saved": saved,
        "seen": float((stacked["visibility"] >= 0.5).mean()),
        "seconds": round(seconds, 4),
        "out": args.out.as_posix(),
    }
    verdict = (
        f"{args.out}: {len(frames)} x {args.size} x {args.size} pixels of {len(counted)} objects; "
        f"{result['queries_per_pixel']:.3g} queries a pixel; the boxes saved {saved:,} of {saved + asked:,}"
    )
    return result | {"verdict": verdict}


def _check(suffix: str, args: argparse.Namespace) -> None:
    """Raise when the file cannot hold what is asked for."""
    from ddf.core import checks

    known = (*image_files.PICTURES, ".npz")
    if suffix not in known:
        raise checks.InputError(f"{args.out}: must end in one of {', '.join(known)}")
    if suffix in image_files.PICTURES and len(args.outputs) > 1:
        raise checks.InputError(f"{args.out}: pictures show one output, .npz holds {len(args.outputs)}")


def _counted(scene: "Scene") -> "tuple[scene_field.SceneField, tuple[scene_field.Counted, ...]]":
    """The scene with fields that count what they are asked for."""
    import dataclasses

    from ddf.fields import scene_field

    assert isinstance(scene.framed, scene_field.SceneField)
    counted = tuple(scene_field.Counted(each) for each in scene.framed.fields)
    return dataclasses.replace(scene.framed, fields=counted), counted


def _cameras(
    field: "scene_field.SceneField", content: "scene_file.SceneFile", args: argparse.Namespace
) -> "list[scene_field.LookAt]":
    """One, or those of the path."""
    from ddf.fields import framed_field, scene_field

    azimuth, elevation, radius = args.camera
    if args.path == "orbit":
        return scene_field.orbit(field, azimuth, elevation, radius, args.frames, content.up)
    if args.path == "fly" and content.fly:
        return scene_field.fly([waypoint.look_at() for waypoint in content.fly], args.frames)
    if radius is None:
        radius = framed_field.framing_radius(field, azimuth, elevation, content.up)
    first = scene_field.one(field, azimuth, elevation, radius, content.up)
    if args.path == "fly":
        return scene_field.fly(scene_field.straight_in(field, first), args.frames)
    return [first]


def _frame(
    field: "scene_field.SceneField", look: "scene_field.LookAt", args: argparse.Namespace, up: str
) -> "dict[str, np.ndarray]":
    """What one camera sees: the outputs asked for and the visibility."""
    from ddf.fields import framed_field
    from ddf.geometry import rays

    found, _ = framed_field.query(field, rays.OrientedPoints(*look.rays(args.size, up)), {"visibility", *args.outputs})
    return {name: values.reshape(args.size, args.size, *values.shape[1:]) for name, values in found.items()}


def _pictures(name: str, stacked: "dict[str, np.ndarray]") -> "list[np.ndarray]":
    """Frames in colours; depths of all frames on one scale."""
    from ddf.pictures import field_pictures

    if name == "depth":
        return field_pictures.depth_pictures(*stacked["depth"])
    frames = range(len(stacked["visibility"]))
    return [field_pictures.picture(name, {key: values[i] for key, values in stacked.items()}) for i in frames]
