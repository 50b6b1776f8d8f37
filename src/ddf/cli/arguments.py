"""Arguments that several commands share, checked before any work; nothing here takes long to import."""

import argparse
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

from ddf.cli.declare import Arg, Command
from ddf.core import errors, shipped_models
from ddf.fields import field_outputs

_MODEL = "model.safetensors"  # of the folder of a field or a model
_FAR = 1e100  # diagonals from which a camera looks, at most
SHADED = "shaded"  # no output of a field, but a picture
Camera = tuple[float, float, float | None]


def require_places(command: Command, args: argparse.Namespace) -> None:
    """Raise before the work when what it gives could not be written, or would replace what it reads.

    Raises:
      FileNotFoundError: a model that it reads is not there.
      InputError: the output's folder does not exist (with --make-folders it is made), no file can have its name, or it
        is a file that the command reads; or nothing can be written there.
    """
    models = list[Path]()
    for each in command.parameters:
        for given in _listed(getattr(args, each.name)) if each.arg.reads else ():
            if is_scene(given) and "scene" not in each.arg.reads:
                raise errors.InputError(f"{given}: scene files are for ddf render, ddf view and ddf.read_scene alone")
            models.append(shipped_models.require(given, *each.arg.reads) / _MODEL)
    out, is_folder = written(command, args)
    if out is None:
        return
    from ddf.core import storage  # takes numpy, which bare help and `ddf doctor` do without

    read = [path for value in vars(args).values() for path in _listed(value)]
    read = [path for path in read if isinstance(path, Path) and path is not out]
    storage.protect(path for path in (*read, *models) if path.is_file())
    target = Path(os.path.realpath(out))  # of a link
    if is_folder:
        if out.is_symlink() and not out.exists():
            raise errors.InputError(f"{out}: a link to {target}, which is not there; make that folder")
        if out.exists() and not out.is_dir():
            raise errors.InputError(f"{out}: is a file; give a folder to write")
        storage.require_not_read(out / _MODEL)
        _require_writable(out, next(each for each in (target, *target.parents) if each.exists()))
        return
    if out.exists() and not out.is_file():
        raise errors.InputError(f"{out}: not a regular file; give the name of a file to write")
    storage.require_not_read(out)
    if args.make_folders:
        target.parent.mkdir(parents=True, exist_ok=True)
    elif not target.parent.is_dir():
        folder = target.parent if out.is_symlink() else out.parent
        raise errors.InputError(f"{out}: there is no folder {folder}; make it, or add --make-folders")
    _require_writable(out, target.parent)


def _require_writable(out: Path, folder: Path) -> None:
    """Raise InputError where no file can be made in a folder; what a system says of its rights is not enough."""
    import tempfile

    try:
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        reason = errors.describe(OSError(error.errno, error.strerror))
        raise errors.InputError(f"{out}: no file can be written in {folder} ({reason}); give another place") from error


def is_scene(path: Path) -> bool:
    """Whether a path is named as scene files are."""
    return path.suffix.lower() in (".yaml", ".yml")


def kept(command: Command, args: argparse.Namespace) -> str:
    """What is left when a command is interrupted that says nothing better; the command itself belongs after a colon."""
    out, is_folder = written(command, args)
    if out is None:
        return command.kept
    there = is_folder and out.is_dir() and any(not each.name.startswith(".") for each in out.iterdir())
    return f"files in {out} are whole; start again by:" if there else f"{out} is not written; start again by:"


def written(command: Command, args: argparse.Namespace) -> tuple[Path | None, bool]:
    """What the command writes, and whether it is a folder."""
    written = next((each for each in command.parameters if each.arg.writes), None)
    return (None, False) if written is None else (getattr(args, written.name), written.arg.writes == "folder")


def _listed(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]


def outputs(text: str) -> tuple[str, ...]:
    """The type of an argument that is a list of outputs with commas."""
    try:
        return field_outputs.require([name.strip() for name in text.split(",") if name.strip()])
    except errors.InputError as error:
        raise argparse.ArgumentTypeError(str(error).removeprefix("outputs ")) from error


def whole_number(least: int, most: int | None = None) -> Callable[[str], int]:
    """The type of an argument that is a whole number in a range."""
    rule = f"must be a whole number, {least} or more" if most is None else f"must be a whole number, {least} to {most}"

    def parse(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = least - 1
        if value < least or (most is not None and value > most):
            raise argparse.ArgumentTypeError(f"{rule}; got {text!r}")
        return value

    return parse


def camera(text: str) -> Camera:
    """The type of --camera: azimuth, elevation and, if given, radius."""
    try:
        azimuth, elevation, *radius = (float(part) for part in text.split(","))
        (distance,) = radius or [None]
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"must be two or three numbers az,el[,r]; got {text!r}") from error
    if not all(map(math.isfinite, (azimuth, elevation, distance or 0.0))) or abs(distance or 0.0) > _FAR:
        raise argparse.ArgumentTypeError(f"must be finite, the distance within {_FAR:g}; got {text!r}")
    if abs(elevation) > 90:
        raise argparse.ArgumentTypeError(f"the elevation must be in -90..90 degrees; got {elevation:g}")
    return azimuth, elevation, distance


def _picture_outputs(text: str) -> tuple[str, ...]:
    if SHADED in text.split(",") and text != SHADED:
        raise argparse.ArgumentTypeError(f"{SHADED} stands alone; got {text!r}")
    return (SHADED,) if text == SHADED else outputs(text)


_OUTPUTS = f"some of {', '.join(field_outputs.OUTPUTS)}"
_FIELD = "folder that `ddf fit` wrote, its model.safetensors, its ONNX file, or a name that `ddf models` lists"
_CAMERA = (
    "azimuth and elevation in degrees, and the distance from the box's centre with 0.57 for one diagonal of the box; "
    "without it the box, or what a shaded picture sees, fills the picture (default 35,25)"
)
_SHADED = f"{SHADED}: grey clay under a lamp, the default of pictures, where numbers are the depth"
_FLAGS = ("--output", "--outputs")
FirstCamera: Camera = (35.0, 25.0, None)

FieldPath = Annotated[Path, Arg("FIELD", parse=shipped_models.place, reads=("field",), help=_FIELD)]
ShownPath = Annotated[
    Path, Arg("FIELD", parse=shipped_models.place, reads=("field", "scene"), help=f"{_FIELD}; or a scene file")
]
ModelPath = Annotated[Path, Arg("MODEL", parse=shipped_models.place, reads=("reconstruction",))]
MeshPath = Annotated[Path, Arg("MESH")]
Rays = Annotated[Path, Arg("RAYS.npz", help="positions, directions: (N, 3), in the frame of the mesh")]
OutFolder = Annotated[Path, Arg("OUT_DIR", writes="folder")]
CameraOption = Annotated[Camera, Arg("AZ,EL[,R]", parse=camera, help=_CAMERA)]
Outputs = Annotated[tuple[str, ...], Arg("NAME,...", parse=outputs, help=_OUTPUTS)]
PictureOutputs = Annotated[
    tuple[str, ...] | None, Arg("NAME,...", _FLAGS, _picture_outputs, f"{_OUTPUTS}; one for a picture; {_SHADED}")
]
Up = Literal["y", "z"]
Points = Annotated[int, Arg("N", ("-n", "--points"), like="n")]
Seed = Annotated[int, Arg("S", parse=whole_number(0, 2**63 - 1))]
Natural = Annotated[int, Arg("N", parse=whole_number(1))]
