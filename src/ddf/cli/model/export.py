"""`ddf export`: a trained model as an ONNX file, compared with the model in onnxruntime first; or as a page."""

import argparse
from typing import Any

from ddf.cli import arguments, results
from ddf.core import shipped_models
from ddf.fields import field_outputs

EXAMPLES = (
    "ddf export rabbit field.onnx",
    "ddf export rabbit small.onnx --precision float16 --outputs depth,visibility",
    "ddf export rabbit armchair pair.html",
)
PRECISIONS = ("float32", "float16", "bfloat16")  # of `onnx_file`
BATCHES = (1, 7, 65536)  # rays that the file and the model are compared with


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare model, file and what goes into it."""
    arguments.mark_known(parser, "model", "field", "reconstruction")
    parser.add_argument(
        "model",
        metavar="MODEL",
        nargs="+",
        type=shipped_models.place,
        help="trained model (artifacts/cpu/train_ddf/chair), a folder that `ddf fit` wrote, or a name of `ddf models`; "
        "several fields for a page alone",
    )
    arguments.add_out(parser, "out", "OUT", "file to write: .onnx, or .html for the page of `ddf view`")
    parser.add_argument(
        "--graph",
        help="field, encoders or image_field of a DDF model (field if not given), pcsiren or pcsiren_encoders",
    )
    parser.add_argument(
        "--outputs",
        type=arguments.outputs,
        metavar="NAME,...",
        help=f"of a field, some of {','.join(field_outputs.OUTPUTS)} (default: all that it has)",
    )
    parser.add_argument(
        "--precision",
        default=PRECISIONS[0],
        choices=PRECISIONS,
        help="of the weights; below float32 the error is reported and held to no tolerance (default %(default)s)",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Export, compare, write; `parity` has the worst difference of every output over all inputs tried."""
    if args.out.suffix.lower() == ".html":
        return _page(args)
    from ddf.core import checks
    from ddf.fields import model_files
    from ddf.io import onnx_file

    model, *others = args.model
    if others:
        raise checks.InputError(f"{args.out}: an ONNX file holds one model; give one, or a name that ends in .html")
    settings = onnx_file.ExportConfig(field_outputs.DEFAULT, BATCHES)
    outputs = args.outputs
    folder = model.parent if model.name == model_files.MODEL else model
    graphs, source = onnx_file.load_graphs(folder, outputs)
    name = args.graph or next(iter(graphs))
    if name not in graphs:
        raise checks.InputError(f"--graph must be one of {', '.join(graphs)} for {folder}; got {name!r}")
    rows = onnx_file.export(graphs[name], name, args.out, source, settings, args.precision)
    parity = onnx_file.figures(rows)
    worst = max(parity, key=lambda output: parity[output]["max_abs"])
    return {
        "graph": name,
        "opset": onnx_file.OPSET,
        "precision": args.precision,
        "bytes": rows[0].bytes,
        "inputs": {key: list(shape) for key, shape in graphs[name].inputs.items()},
        "parity": parity,
        "table": results.grid(
            ("output", "largest difference", "tolerance"),
            [(output, entry["max_abs"], entry["tolerance"]) for output, entry in parity.items()],
        ),
        "verdict": f"{args.out}: graph {name}, opset {onnx_file.OPSET}, {args.precision}, {rows[0].bytes:,} bytes; "
        f"onnxruntime and torch differ most in {worst}, by {results.cell(parity[worst]['max_abs'])}",
    }


def _page(args: argparse.Namespace) -> dict[str, Any]:
    """The page that renders the model live."""
    from ddf.cli.field import view
    from ddf.io import viewer_page

    size = viewer_page.write(args.out, view.page_of(args.model))
    return {"out": args.out.as_posix(), "bytes": size, "verdict": f"{args.out}: {size:,} bytes; any browser opens it"}
