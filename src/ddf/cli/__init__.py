"""The `ddf` command: one module per command, imported only when it is called.

A command module has `add_arguments(parser)` and `run(args) -> dict`. The dict is the result: printed as one JSON
object with --json, else as lines of `key: value`; a `text` key, if there is one, replaces these lines.
"""

import argparse
import contextlib
import importlib
import json
import math
import os
import sys
from collections.abc import Iterator, Sequence
from typing import Any

from ddf.pipeline import stage

COMMANDS = {
    "doctor": "what this machine has, what is missing and the command for it",
    "info": "models with exact parameter counts, stages and sizes of an experiment file",
    "split": "the Pixel2Mesh train and test lists of a listing of shapes or a ShapeNet root",
    "mesh": "validate a mesh, make it watertight, decimate and normalise it; say what was lost",
    "cast": "exact depth, visibility and normals of a mesh along given rays",
    "samples": "the six types of oriented-point samples of a mesh",
    "fit": "fit a field to one mesh, with held-out errors per sample type",
    "query": "visibility, depth, normals and curvatures of a fitted field along given rays",
    "render": "a picture of a fitted field: depth, visibility, normals or curvature",
    "points": "a point cloud on the surface of a fitted field",
    "compare": "Chamfer distance and F-scores of two point clouds",
    "reconstruct": "camera, cloud and renders from one image with a trained model",
    "export": "a trained model as an ONNX file, checked against onnxruntime",
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; exit code 0, or 2 after one line on stderr when the input is at fault."""
    argv = list(sys.argv[1:] if argv is None else argv)
    parser = _Parser(prog="ddf", description="Directed distance fields: oriented points in, visibility and depth out.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=_Parser)
    chosen = next((word for word in argv if not word.startswith("-")), None)
    for name, summary in COMMANDS.items():
        command = commands.add_parser(name, help=summary, description=summary)
        command.add_argument("--json", action="store_true", help="print one JSON object on stdout")
        if name == chosen:
            importlib.import_module(f"ddf.cli.{name}").add_arguments(command)
    args = parser.parse_args(argv)
    return stage.guarded(lambda: _run(args), f"ddf {args.command}")


def _run(args: argparse.Namespace) -> None:
    module = importlib.import_module(f"ddf.cli.{args.command}")
    with _stdout_to_stderr() if args.json else contextlib.nullcontext():
        result: dict[str, Any] = module.run(args)
    text = result.pop("text", None)
    if args.json:
        text = json.dumps(_jsonable(result), allow_nan=False)
    elif text is None:
        text = "\n".join(f"{key}: {value}" for key, value in _flat(result))
    sys.stdout.write(text.rstrip("\n") + "\n")
    sys.stdout.flush()


class _Parser(argparse.ArgumentParser):
    """argparse with errors in one line."""

    def error(self, message: str) -> Any:
        self.exit(2, f"{self.prog}: error: {message} (see {self.prog} --help)\n")


@contextlib.contextmanager
def _stdout_to_stderr() -> Iterator[None]:
    """Send what libraries print on stdout, from native code too, to stderr, so that --json prints JSON alone."""
    sys.stdout.flush()
    saved = os.dup(1)
    try:
        os.dup2(2, 1)
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        sys.stdout.flush()
        os.dup2(saved, 1)
        os.close(saved)


def _jsonable(value: Any) -> Any:
    """Plain values for JSON, which has neither NaN nor infinity: these become null."""
    if isinstance(value, dict):
        return {str(key): _jsonable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_jsonable(item) for item in value]
    if hasattr(value, "tolist"):
        return _jsonable(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def _flat(result: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in result.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value
