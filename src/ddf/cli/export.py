"""`ddf export`: a trained model as an ONNX file, compared with the model in onnxruntime before it is written."""

import argparse
from pathlib import Path
from typing import Any

from ddf.core import checks, config
from ddf.export import exportable, onnx_file, weight_precision
from ddf.fields import field_outputs
from ddf.training import training_loop

DEFAULTS = onnx_file.ExportConfig(tuple(field_outputs.OUTPUTS), (1, 7, 65536), (), 0)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare model, file and what goes into it."""
    parser.add_argument(
        "model",
        metavar="MODEL",
        type=Path,
        help="trained model (artifacts/cpu/train_ddf/chair), or a folder that `ddf fit` wrote",
    )
    parser.add_argument("out", metavar="OUT.onnx", type=Path, help="file to write")
    parser.add_argument(
        "--graph",
        help="field, encoders or image_field of a DDF model (field if not given), pcsiren or pcsiren_encoders",
    )
    parser.add_argument(
        "--outputs",
        type=lambda text: tuple(text.split(",")),
        metavar="NAME,...",
        help=f"of a field, among {','.join(field_outputs.OUTPUTS)} (default: all, or those of --config)",
    )
    parser.add_argument("--config", type=Path, metavar="CONFIG", help="experiment file; its section `export` is used")
    parser.add_argument(
        "--precision",
        default=weight_precision.FULL,
        choices=(weight_precision.FULL, *weight_precision.PRECISIONS),
        help="of the weights; below float32 the error is reported and held to no tolerance (default %(default)s)",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Export, compare, write; `parity` has the worst difference of every output over all inputs tried."""
    settings = DEFAULTS
    if args.config is not None:
        settings = config.load(args.config, "export", onnx_file.ExportConfig)
    outputs = settings.outputs if args.outputs is None else field_outputs.require_outputs(args.outputs)
    folder = args.model.parent if args.model.name == training_loop.MODEL else args.model
    graphs, source = exportable.load(folder, outputs)
    name = args.graph or next(iter(graphs))
    if name not in graphs:
        raise checks.InputError(f"--graph must be one of {', '.join(graphs)} for {folder}; got {name!r}")
    rows = onnx_file.export(graphs[name], name, args.out, source, settings, args.precision)
    return {
        "graph": name,
        "opset": onnx_file.OPSET,
        "precision": args.precision,
        "bytes": rows[0].bytes,
        "inputs": {key: list(shape) for key, shape in graphs[name].inputs.items()},
        "parity": onnx_file.figures(rows),
    }
