"""The commands of `ddf`, one line each: a new command is one module and its line here.

A command module has `EXAMPLES` (command lines, for its help and docs/commands.md), `add_arguments(parser)` and
`run(args) -> dict`. It is imported when it is called, and what takes long to load only inside `run`. The dict is the
result, one JSON object with --json. Two keys are for people alone: `table` (label to value, shown instead of the rest)
and `verdict` (one line, shown last).
"""

import importlib
import importlib.util
from typing import Any, NamedTuple


class Command(NamedTuple):
    """The room of a command in the help, its module (or what a module names, behind a colon), and what it does."""

    room: str
    module: str
    summary: str

    def load(self) -> Any:
        """Import it."""
        module, _, name = self.module.partition(":")
        found = importlib.import_module(module)
        return getattr(found, name) if name else found


ROOMS = {"mesh": "meshes and clouds", "field": "fields", "model": "trained models", "experiment": "experiments"}
COMMANDS = {
    "mesh": Command("mesh", "ddf.cli.mesh.mesh", "validate, close, decimate and normalise a mesh; say what was lost"),
    "cast": Command("mesh", "ddf.cli.mesh.cast", "exact depth, visibility and normals of a mesh along given rays"),
    "samples": Command("mesh", "ddf.cli.mesh.samples", "the six types of oriented-point samples of a mesh"),
    "compare": Command("mesh", "ddf.cli.mesh.compare", "Chamfer distance and F-scores of two clouds or meshes"),
    "shapes": Command(
        "mesh", "ddf.cli.mesh.shapes", "shapes of other people: chairs, planes, cars, ...; fetching them"
    ),
    "fit": Command("field", "ddf.cli.field.fit", "fit a field to one mesh, with held-out errors per sample type"),
    "query": Command(
        "field", "ddf.cli.field.query", "what a field says along given rays: depth, visibility, normals, ..."
    ),
    "render": Command("field", "ddf.cli.field.render", "a picture, or the arrays, of what a camera sees of a field"),
    "view": Command(
        "field", "ddf.cli.field.view", "a page that renders a field live, as one file that any browser opens"
    ),
    "points": Command("field", "ddf.cli.field.points", "a point cloud with normals on the surface of a field"),
    "udf": Command(
        "field", "ddf.cli.field.udf", "unsigned distances to the surface of a field, and where it is nearest"
    ),
    "surface": Command(
        "field", "ddf.cli.field.surface", "a triangle mesh of a field, and how near it is to the true one"
    ),
    "scene": Command("field", "ddf.cli.field.scene", "several fields in one scene, from one camera or along a path"),
    "models": Command("model", "ddf.cli.model.models", "the trained models and fields that come with the package"),
    "reconstruct": Command(
        "model", "ddf.cli.model.reconstruct", "field, mesh, cloud and camera from a picture with a trained model"
    ),
    "complete": Command(
        "model", "ddf.cli.model.complete", "the whole object, and its pose, from a depth image or a lidar scan of it"
    ),
    "generate": Command(
        "model", "ddf.cli.model.generate", "samples of a shape VAE and an image GAN: fields, normals, images"
    ),
    "export": Command("model", "ddf.cli.model.export", "a trained model as an ONNX file, checked against onnxruntime"),
    "config": Command("experiment", "ddf.cli.config", "every setting of a fit, with its reasons"),
    "split": Command("experiment", "ddf.cli.mesh.split", "the Pixel2Mesh train and test lists of a ShapeNet root"),
    "doctor": Command("experiment", "ddf.cli.doctor", "what this machine has, what is missing and the command for it"),
}
IN_A_CHECKOUT = ("run", "info")  # those that `ddf_lab` brings
if importlib.util.find_spec("ddf_lab"):
    COMMANDS |= {name: Command(*entry) for name, entry in importlib.import_module("ddf_lab.commands").COMMANDS.items()}
