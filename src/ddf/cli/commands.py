"""The commands of `ddf`, one line each: a new command is one module and its line here.

A command module has `EXAMPLES` (command lines, for its help and docs/commands.md), `add_arguments(parser)` and
`run(args) -> dict`. It is imported when it is called, and what takes long to load only inside `run`. The dict is the
result, one JSON object with --json. Two keys are for people alone: `table` (label to value, shown instead of the rest)
and `verdict` (one line, shown last).
"""

from typing import NamedTuple


class Command(NamedTuple):
    """Where a command is, below `ddf.cli`, and what it does."""

    module: str
    summary: str


ROOMS = {"mesh": "meshes and clouds", "field": "fields", "model": "trained models", "experiment": "experiments"}
COMMANDS = {
    "mesh": Command("mesh.mesh", "validate, close, decimate and normalise a mesh; say what was lost"),
    "cast": Command("mesh.cast", "exact depth, visibility and normals of a mesh along given rays"),
    "samples": Command("mesh.samples", "the six types of oriented-point samples of a mesh"),
    "compare": Command("mesh.compare", "Chamfer distance and F-scores of two clouds or meshes"),
    "fit": Command("field.fit", "fit a field to one mesh, with held-out errors per sample type"),
    "query": Command("field.query", "what a field says along given rays: depth, visibility, normals, ..."),
    "render": Command("field.render", "a picture, or the arrays, of what a camera sees of a field"),
    "view": Command("field.view", "a page that renders a field live, as one file that any browser opens"),
    "points": Command("field.points", "a point cloud with normals on the surface of a field"),
    "udf": Command("field.udf", "unsigned distances to the surface of a field, and where it is nearest"),
    "surface": Command("field.surface", "a triangle mesh of a field, and how near it is to the true one"),
    "scene": Command("field.scene", "several fields in one scene, from one camera or along a path"),
    "models": Command("model.models", "the trained models and fields that come with the package"),
    "reconstruct": Command("model.reconstruct", "camera, cloud and renders from images with a trained model"),
    "generate": Command("model.generate", "samples of a shape VAE and an image GAN: fields, normals, images"),
    "export": Command("model.export", "a trained model as an ONNX file, checked against onnxruntime"),
    "run": Command("experiment.run", "an experiment file through all its stages, to tables, figures and report"),
    "info": Command("experiment.info", "models, stages, sizes and cost of an experiment file"),
    "split": Command("experiment.split", "the Pixel2Mesh train and test lists of a ShapeNet root"),
    "doctor": Command("experiment.doctor", "what this machine has, what is missing and the command for it"),
}
