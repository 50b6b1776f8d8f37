"""A field fitted to one shape: its file, and how torch evaluates it; what it can be asked for is in `framed_field`."""

from collections.abc import Collection
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from ddf.core import checks
from ddf.fields import cloud_projection, field_file, field_outputs, field_values, framed_field, model_files, rendering
from ddf.fields.pddf import PDDF, PDDFConfig
from ddf.geometry import transforms

NEEDED = ("hidden", "omega_first", "omega_hidden", "depth_activation", "depth_sharpness")  # of a field's record


@dataclass(frozen=True)
class ShapeField:
    """A trained field of one shape, its box (field frame), the map to its frame, and the record of its file."""

    field: PDDF
    lower: Float[np.ndarray, "3"]
    upper: Float[np.ndarray, "3"]
    field_from_mesh: transforms.Similarity
    record: dict[str, Any]

    @property
    def parameters(self) -> int:
        """Numbers that make the field."""
        return sum(each.numel() for each in self.field.parameters())

    @property
    def outputs(self) -> tuple[str, ...]:
        """All."""
        return tuple(field_outputs.OUTPUTS)

    @property
    def scalar(self) -> Float[Tensor, ""]:
        """Cameras are computed by torch."""
        return torch.zeros((), dtype=torch.float64)

    @torch.no_grad()
    def evaluate(
        self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"], outputs: Collection[str]
    ) -> dict[str, Float[np.ndarray, "n ..."]]:
        """Named outputs inside the box, field frame, in the network's own type."""
        weight = self.field.network.head.weight
        inside, looking = (torch.from_numpy(values).to(weight) for values in (positions, directions))
        found = field_values.evaluate(self.field, inside, looking, outputs)
        return {name: values.cpu().numpy() for name, values in found.items()}

    @torch.no_grad()
    def points(self, count: int, seed: int = 0) -> Float[np.ndarray, "count 3"]:
        """Points on the surface, mesh frame, by `cloud_projection.USUAL` in the field's own box."""
        if count < 1:
            raise checks.InputError(f"the number of points must be >= 1; got {count}")
        generator = torch.Generator(self.field.network.head.weight.device).manual_seed(seed)
        box = (self.lower.tolist(), self.upper.tolist())
        kept = cloud_projection.draw(self.field, None, count, cloud_projection.USUAL, generator, box)
        return self.field_from_mesh.inverse().apply(kept.double().cpu().numpy())

    def save(self, folder: Path) -> Path:
        """The field's file, as `ddf fit` writes it."""
        described = description(self.field.config, self.lower, self.upper, self.field_from_mesh)
        return field_file.write(folder, dict(self.field.state_dict()), {**self.record, **described})


def description(
    config: PDDFConfig,
    lower: Float[np.ndarray, "3"],
    upper: Float[np.ndarray, "3"],
    field_from_mesh: transforms.Similarity,
) -> dict[str, Any]:
    """What the record of a field file must hold for `load`, besides what every artefact carries."""
    return {
        "kind": field_file.KIND,
        "field": asdict(config),
        "box": {"lower": lower.tolist(), "upper": upper.tolist()},
        "field_from_mesh": field_from_mesh.to_dict(),
    }


def in_cube(field: PDDF, v1_from_field: float) -> ShapeField:
    """A field whose box is the cube, as conditional ones have it, and the frame of the mesh v1 (`transforms`)."""
    upper = np.full(3, rendering.CUBE_HALF)
    return ShapeField(field, -upper, upper, transforms.Similarity(1 / v1_from_field), {})


def load(path: Path) -> ShapeField:
    """A field from its file, or from the folder that `ddf fit` wrote, in evaluation mode."""
    from ddf.core import config  # takes yaml, which inference does without

    stored = field_file.read(path)
    with framed_field.record_of(stored.file):
        how = config.recorded(stored.record["field"], PDDFConfig, "field", NEEDED)
    field = model_files.built(lambda: PDDF(how), stored.file.parent, name=stored.file.name)
    return ShapeField(field, stored.lower, stored.upper, stored.field_from_mesh, stored.record)
