"""What a field can be asked for: the one list of queries, renders, pictures, pages, ONNX files and help. Without torch.

`field_values` computes in the field frame, whose box is [-1, 1]^3; answers are in the frame of the mesh.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from ddf.core import errors

READS = ("values", "gradient", "curvature")  # passes of a network, each with those before it
DEFAULT = ("visibility", "depth", "normals")


@dataclass(frozen=True)
class Output:
    """One named output of a field.

    compute: from `FieldValues`, first axis the points. unit: of answers; length: power of a length in it. meaning: for
    ONNX files. kind: how it is drawn; `directions` turn with the axes too. reads: the farthest of the passes `READS`
    that it needs. tolerance: largest difference between two correct float32 programs, over max(1, |value|) where
    `relative`. clear: the points where it is continuous, so that the tolerance can hold.
    """

    compute: Callable[[Any], Any]
    unit: str
    meaning: str
    kind: Literal["probability", "depth", "directions", "share", "signed"] = "signed"
    length: int = 0
    reads: Literal["values", "gradient", "curvature"] = "values"
    tolerance: float = 1e-5
    relative: bool = False
    clear: Callable[[Any], Any] = lambda values: values.everywhere


def _component_normals(index: int) -> Output:
    """Facing back, whichever component is heavier: a lighter one may show the surface behind. Source: [DDF22] §3.3."""
    return Output(
        lambda values: values.component_normals(index),
        f"unit vectors of component {index + 1}",
        f"n_{index + 1}, unit normal of component {index + 1}, facing back; meaningless where nothing is visible",
        "directions",
        reads="gradient",
        tolerance=8.7e-4,
        clear=lambda values: values.component_normal_is_clear(index),
    )


# A new output is one entry here.
OUTPUTS: dict[str, Output] = {
    "visibility": Output(
        lambda values: values.visibility, "probability", "ξ in [0, 1]: does the ray hit", "probability"
    ),
    "depth": Output(
        lambda values: values.depth,
        "mesh units along the ray",
        "distance along the ray to its first hit, field units; meaningless where nothing is visible",
        "depth",
        length=1,
        clear=lambda values: values.component_is_clear,
    ),
    "normals": Output(
        lambda values: values.normals,
        "unit vectors, axes of the mesh",
        "unit normal at the hit, facing back (n·v <= 0); meaningless where nothing is visible",
        "directions",
        reads="gradient",
        tolerance=8.7e-4,  # the chord of 0.05 degrees
        clear=lambda values: values.normal_is_clear,
    ),
    "mean_curvature": Output(
        lambda values: values.surface.mean,
        "1 / mesh unit",
        "tr(II), no factor 1/2, in 1/field units; -2/r on a sphere seen from outside; meaningless where unseen",
        length=-1,
        reads="curvature",
        tolerance=2e-3,  # second derivatives cancel, and a tangent basis turns with the normal
        relative=True,
        clear=lambda values: values.normal_is_clear,
    ),
    "gaussian_curvature": Output(
        lambda values: values.surface.gaussian,
        "1 / mesh unit²",
        "det(II) in 1/(field units)^2; 1/r^2 on a sphere; meaningless where nothing is visible",
        length=-2,
        reads="curvature",
        tolerance=2e-3,
        relative=True,
        clear=lambda values: values.normal_is_clear,
    ),
    "weight_1": Output(
        lambda values: values.weights[..., 0],
        "share of component 1 of the mixture",
        "w_1, share of component 1 of the mixture",  # from 1/2 on that gives the depth
        "share",
    ),
    "normals_1": _component_normals(0),
    "normals_2": _component_normals(1),
}


def require(asked: Collection[str], known: Sequence[str] = tuple(OUTPUTS)) -> tuple[str, ...]:
    """What is asked for, as a tuple; InputError where it is nothing, one twice, or one that is not known."""
    unknown = [name for name in asked if name not in known]
    if unknown or not asked or len(set(asked)) < len(asked):
        raise errors.InputError(
            f"outputs must be among {errors.known_names((*unknown, '')[0], known)}, each once; got "
            f"{', '.join(unknown or asked) or 'none'}"
        )
    return tuple(asked)
