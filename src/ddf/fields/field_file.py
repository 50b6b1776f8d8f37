"""The file of a field of one shape: its record, and its weights as arrays. Needs no torch."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from ddf.core import checks, storage
from ddf.fields import framed_field
from ddf.geometry import transforms

KIND, PATCHES = "single_shape", "patches"  # of the record: a network, and what `patch_field` reads
MODEL = "model.safetensors"  # of the folder that `ddf fit` writes


@dataclass(frozen=True)
class FieldFile:
    """What the record says: the box (field frame), the map to its frame, the keys of `pddf.PDDFConfig`."""

    file: Path
    lower: Float[np.ndarray, "3"]
    upper: Float[np.ndarray, "3"]
    field_from_mesh: transforms.Similarity
    config: dict[str, Any]
    record: dict[str, Any]

    def layers(self) -> list[tuple[Float[np.ndarray, "out in"], Float[np.ndarray, "out"], float]]:
        """Weights, biases and ω of each sine layer; the head last, with ω = 1. InputError where the file holds another
        architecture.
        """
        tensors, count = storage.load_tensors(self.file)[0], len(self.config["hidden"])
        omegas = [self.config["omega_first"], *[self.config["omega_hidden"]] * (count - 1), 1.0]
        names = [*(f"network.layers.{index}" for index in range(count)), "network.head"]
        widths = [6, *self.config["hidden"], 4]
        found = [tuple(tensors.get(f"{name}.{part}", np.zeros(0)) for part in ("weight", "bias")) for name in names]
        for index, (weight, bias) in enumerate(found):
            if weight.shape != (widths[index + 1], widths[index]) or bias.shape != weight.shape[:1]:
                raise checks.InputError(f"{self.file}: does not fit the architecture of its config: {names[index]}")
            checks.require_finite(f"{self.file}: {names[index]}", weight)
        return [(weight, bias, omega) for (weight, bias), omega in zip(found, omegas, strict=True)]


def write(folder: Path, tensors: Mapping[str, Any], record: Mapping[str, Any]) -> Path:
    """A field's file in a folder, as `ddf fit` does."""
    path = folder / MODEL
    own = {name: value for name, value in record.items() if name != "checksum"}  # it is of the old file
    storage.save_tensors(path, tensors, {"fingerprint": "", "seed": 0, "sources": {}, **own})
    return path


def file_of(path: Path) -> Path:
    """The path itself, or the file of the folder that it is; of an ONNX file, which has no weights of ours, none."""
    return path if (path.is_file() and path.suffix != ".onnx") or path.name == MODEL else path / MODEL


def read(path: Path) -> FieldFile:
    """A field's record, from its file or the folder that `ddf fit` wrote."""
    file = file_of(path)
    if not file.exists():
        raise FileNotFoundError(f"{file}: no such field; give a folder that `ddf fit` wrote")
    record = storage.load_metadata(file)
    if record.get("kind") == PATCHES:
        raise checks.InputError(f"{file}: holds patches, this needs a network's weights: fit it with `--kind sine`")
    if record.get("kind") != KIND:
        raise checks.InputError(f"{file}: holds no field of a single shape; give a folder that `ddf fit` wrote")
    with framed_field.record_of(file):
        config = {**record["field"], "hidden": tuple(record["field"]["hidden"])}
        for width in config["hidden"]:
            checks.require_whole("a width", width, 1)
        for name in ("omega_first", "omega_hidden", "depth_sharpness"):
            config[name] = float(config[name])
            checks.require_finite(name, np.array(config[name]))
        lower, upper = framed_field.corners(record["box"]["lower"], record["box"]["upper"])
        field_from_mesh = transforms.Similarity.from_dict(record["field_from_mesh"])
    return FieldFile(file, lower, upper, field_from_mesh, config, record)
