"""Trained models as the small files that come with the package: matrices in float16, an ONNX file, a card."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from ddf.core import storage
from ddf.fields import model_files
from ddf.io import onnx_file, onnx_parity

ONNX = "field.onnx"
CARD = "card.md"
INDEX = "index.json"


def rounded(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Matrices and convolution kernels as float16; vectors, statistics and buffers as they are.

    A weight keeps 11 significant bits. Loading widens it to float32 again.
    """
    wide = {torch.float32, torch.float64}
    return {name: value.half() if value.dtype in wide and value.ndim >= 2 else value for name, value in tensors.items()}


def write_weights(folder: Path, out: Path, changes: Mapping[str, Any] | None = None) -> Path:
    """The model of a training's folder as `out`/model.safetensors with `rounded` weights; returns the file.

    Args:
      changes: entries of the record to replace.
    """
    tensors, record = storage.load_tensors(folder / model_files.MODEL, framework="torch")
    file = out / model_files.MODEL
    storage.save_tensors(file, rounded(tensors), record | dict(changes or {}) | {"weights": "float16"})
    return file


def write_onnx(out: Path, config: onnx_file.ExportConfig) -> list[onnx_parity.Row]:
    """The field of `out` as `out`/field.onnx, compared with torch before it is written; returns the comparison."""
    graphs, source = onnx_file.load_graphs(out, config.outputs)
    return onnx_file.export(graphs["field"], "field", out / ONNX, source, config)


def write_card(out: Path, name: str, summary: str, sections: Mapping[str, Sequence[str]]) -> None:
    """The card of a model as Markdown: a sentence, then bullets under headings."""
    lines = [f"# {name}", "", summary, ""]
    for heading, bullets in sections.items():
        lines += [f"## {heading}", "", *(f"- {bullet}" for bullet in bullets), ""]
    storage.write_text(out / CARD, "\n".join(lines).rstrip("\n") + "\n")


def read_index(root: Path) -> list[dict[str, Any]]:
    """The entries that `write_index` was given."""
    models = storage.read_json(root / INDEX)["models"]
    return [{key: value for key, value in model.items() if key != "files"} for model in models]


def write_index(root: Path, entries: Sequence[Mapping[str, Any]]) -> None:
    """index.json of the folder of models: per model its name, kind, summary, and files with their sizes.

    Args:
      root: holds one folder per model, called by its name.
      entries: `name`, `kind` (field or reconstruction) and `summary` of each.
    """
    models = []
    for entry in entries:
        files = sorted(path for path in (root / entry["name"]).iterdir() if path.is_file())
        models.append({**entry, "files": {path.name: path.stat().st_size for path in files}})
    storage.write_text(root / INDEX, json.dumps({"models": models}, indent=2) + "\n")
