"""Arguments that several commands share, checked before any work; nothing here takes long to import."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ddf.core import shipped_models
from ddf.fields import field_outputs

SHADED = "shaded"  # no output of a field, but a picture
UP_AXES = ("y", "z")  # as `framed_field.UP_AXES`
_READS = "reads"  # of the parsed arguments: the name of the one that names models, and their kinds
_WRITES = "writes"  # of the parsed arguments: the name of the one that is written, and whether it is a folder


def add_field(parser: argparse.ArgumentParser) -> None:
    """The fitted field that a command reads."""
    mark_known(parser, "field", "field")
    parser.add_argument(
        "field",
        metavar="FIELD",
        type=shipped_models.place,
        help="folder that `ddf fit` wrote, its model.safetensors, its ONNX file, or a name that `ddf models` lists",
    )


def mark_known(parser: argparse.ArgumentParser, name: str, *kinds: str) -> None:
    """Let `require_places` check that the models of that name in the parsed arguments are there."""
    parser.set_defaults(**{_READS: (name, kinds)})


def add_rays(parser: argparse.ArgumentParser, frame: str) -> None:
    """The rays that a command reads with `rays.read_npz`; frame: whose frame they are in."""
    parser.add_argument(
        "--rays",
        metavar="RAYS.npz",
        type=Path,
        required=True,
        help=f"positions, directions: (N, 3), in the {frame}'s frame",
    )


def add_out(parser: argparse.ArgumentParser, name: str, metavar: str, help: str) -> None:
    """A file that the command writes, `out` or `--out`; its folder must be there, or be asked for."""
    how: dict[str, Any] = {"required": True} if name.startswith("-") else {}
    parser.add_argument(name, metavar=metavar, type=Path, help=help, **how)
    mark_out(parser, name.lstrip("-"))


def add_folder(parser: argparse.ArgumentParser, help: str, name: str = "out", **how: Any) -> None:
    """A folder that the command writes, made if needed."""
    parser.add_argument(name, type=Path, help=f"folder, made if needed; {help}", **{"metavar": "OUT_DIR", **how})
    parser.set_defaults(**{_WRITES: (name.lstrip("-"), True)})


def mark_out(parser: argparse.ArgumentParser, name: str) -> None:
    """Let `require_places` check the file of that name in the parsed arguments."""
    parser.set_defaults(**{_WRITES: (name, False)})
    parser.add_argument("--make-folders", action="store_true", help="make the folder of the output where it is missing")


def add_picture(parser: argparse.ArgumentParser, largest: int, one: str, default: str | None = "depth") -> None:
    """Size and outputs of what a camera sees.

    Args:
      largest: pixels a side, at most. one: what takes one output alone, for the help.
      default: outputs; None where the command has `SHADED` too, and chooses.
    """
    more = (
        "" if default else f"; {SHADED}: grey clay under a lamp, the default of pictures, where numbers are the depth"
    )
    parser.add_argument(
        "--size", metavar="N", type=whole_number(1, largest), default=256, help="pixels a side (default 256)"
    )
    parser.add_argument(
        "--output",
        "--outputs",
        dest="outputs",
        metavar="NAME,...",
        type=outputs if default else lambda text: (SHADED,) if text == SHADED else outputs(text),
        default=default,
        help=f"some of {','.join(field_outputs.OUTPUTS)}; one for {one}{more or ' (default %(default)s)'}",
    )


def require_places(args: argparse.Namespace) -> None:
    """Raise before the work when what it gives could not be written, or would replace what it reads.

    Raises:
      FileNotFoundError: a model that it reads is not there.
      InputError: the output's folder does not exist (with --make-folders it is made), no file can have its name, or it
        is a file that the command reads.
    """
    model, kinds = getattr(args, _READS, ("", ()))
    for given in _listed(getattr(args, model, [])):
        shipped_models.require(given, *kinds)
    name, is_folder = getattr(args, _WRITES, ("", False))
    out = getattr(args, name, None)
    if out is None:
        return
    from ddf.core import checks, storage  # take numpy, which bare help and `ddf doctor` do without

    read = [path for value in vars(args).values() for path in _listed(value)]
    storage.protect(path for path in read if isinstance(path, Path) and path is not out and path.is_file())
    if is_folder:
        if out.exists() and not out.is_dir():
            raise checks.InputError(f"{out}: is a file; give a folder to write")
        return
    if out.exists() and not out.is_file():
        raise checks.InputError(f"{out}: not a regular file; give the name of a file to write")
    storage.require_not_read(out)
    if args.make_folders:
        out.parent.mkdir(parents=True, exist_ok=True)
    elif not out.parent.is_dir():
        raise checks.InputError(f"{out}: there is no folder {out.parent}; make it, or add --make-folders")


def _listed(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]


def kept(args: argparse.Namespace) -> str:
    """What is left when a command is interrupted that says nothing better; the command itself belongs after a colon."""
    name, is_folder = getattr(args, _WRITES, ("", False))
    out = getattr(args, name, None)
    if out is None:
        return getattr(args, "kept", "")
    return f"files in {out} are whole; start again by:" if is_folder else f"{out} is not written; start again by:"


def outputs(text: str) -> tuple[str, ...]:
    """The type of an argument that is a list of outputs with commas."""
    from ddf.core import checks

    try:
        return field_outputs.require([name.strip() for name in text.split(",") if name.strip()])
    except checks.InputError as error:
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
