"""Trained models by their folder, as the graphs that can be exported of them."""

from pathlib import Path
from typing import Any

from ddf.core import checks, storage
from ddf.fields import field_file, model_files, shape_field
from ddf.fields.grid import patch_field
from ddf.io import onnx_file, onnx_graphs, patch_graph
from ddf.io.onnx_graphs import Graph
from ddf.models import reconstruction_models


def load(folder: Path, outputs: tuple[str, ...] | None) -> tuple[dict[str, Graph], dict[str, Any]]:
    """The graphs of a model by name, the plainest first, and the facts about their source for the files.

    Args:
      folder: what a training stage wrote. outputs: of fields, None for all.
    Raises:
      FileNotFoundError: there is no model. InputError: it is damaged, or of a kind that is not known.
    """
    path = folder / model_files.MODEL
    record = storage.load_metadata(path)
    if record.get("kind") == field_file.PATCHES:
        return {"field": patch_graph.PatchGraph(patch_field.load(path), outputs)}, onnx_file.describe_source(
            path, record
        )
    if record.get("kind") == field_file.KIND:
        shape = shape_field.load(folder)
        graphs: dict[str, Graph] = {"field": onnx_graphs.FieldGraph(shape.field.cpu(), outputs)}
        return graphs, onnx_file.describe_source(path, record)
    if record.get("kind") not in ("ddf", "pcsiren"):
        raise checks.InputError(
            f"{folder}: holds no DDF or PC-SIREN model and no field; give a folder that `make train` or `ddf fit` wrote"
        )
    if record["kind"] == "ddf":
        ddf, image_size = reconstruction_models.load_ddf(folder, record)
        graphs = onnx_graphs.ddf_graphs(ddf.cpu(), image_size, outputs)
    else:
        pcsiren, image_size = reconstruction_models.load_pcsiren(folder, record)
        graphs = onnx_graphs.pcsiren_graphs(pcsiren.cpu(), image_size)
    return graphs, onnx_file.describe_source(path, record)
